// Presses of a trigger that would confirm a plan, of whatever hand or key: of a doubtful grasp the first one only asks.

import { isDoubtful } from "./hints.js";
import { HANDS } from "./wire_table.js";

export class Confirming {
  /** `ask(told)`: the user is to be asked whether a grasp that is foreseen so is confirmed all the same. */
  constructor(ask) {
    this.ask = ask;
    this.asked = ""; // digest of the plan of which the user was asked
    this.down = new Set(); // hands whose trigger is pressed
    this.withheld = new Set(); // of these, those of which the server does not hear
  }

  /**
   * What the server shall hear of `hands`, whose triggers are changed. A press counts from where it begins to where it
   * ends. One that begins before the preview's end does nothing, so that it never confirms what was not read yet.
   */
  heard(hands, mode, told) {
    const gripped = HANDS.some((side) => hands[side].grip);
    for (const side of HANDS) {
      const { trigger } = hands[side];
      if (!trigger) this.withheld.delete(side);
      else if (!this.down.has(side) && this.isWithheld(mode, told, gripped)) this.withheld.add(side);
      this.down[trigger ? "add" : "delete"](side);
      if (this.withheld.has(side)) hands[side].trigger = false;
    }
    return hands;
  }

  isWithheld(mode, told, gripped) {
    if (mode === "preview") return true;
    if (mode !== "ready" || !isDoubtful(told) || this.asked === told.digest) return false;
    if (gripped) {
      this.asked = told.digest;
      this.ask(told);
    }
    return gripped; // without a grip nothing is confirmed, and the server says what is missing
  }
}
