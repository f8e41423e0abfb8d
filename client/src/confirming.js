// Presses of a trigger that would confirm a plan, of any hand or key. Of a doubtful grasp the first press only asks.

import { isDoubtful } from "./hints.js";
import { HANDS } from "./wire_table.js";

export class Confirming {
  /** `ask(prediction)` asks the user whether to confirm a grasp with this prediction all the same. */
  constructor(ask) {
    this.ask = ask;
    this.askedDigest = ""; // digest of the plan about which the user was asked
    this.down = new Set(); // hands whose trigger is pressed
    this.withheld = new Set(); // of these, those whose press is not sent
  }

  /**
   * The `hands` to send, whose triggers are changed in place. A press counts from where it begins to where it ends. A
   * press that begins before the preview's end does nothing, so that it never confirms what was not read yet.
   */
  filter(hands, mode, prediction) {
    const gripped = HANDS.some((side) => hands[side].grip);
    for (const side of HANDS) {
      const { trigger } = hands[side];
      if (!trigger) this.withheld.delete(side);
      else if (!this.down.has(side) && this.isWithheld(mode, prediction, gripped)) this.withheld.add(side);
      this.down[trigger ? "add" : "delete"](side);
      if (this.withheld.has(side)) hands[side].trigger = false;
    }
    return hands;
  }

  isWithheld(mode, prediction, gripped) {
    if (mode === "preview") return true;
    if (mode !== "ready" || !isDoubtful(prediction) || this.askedDigest === prediction.digest) return false;
    if (gripped) {
      this.askedDigest = prediction.digest;
      this.ask(prediction);
    }
    return gripped; // without a grip nothing is confirmed, and the server's notice names what is missing
  }
}
