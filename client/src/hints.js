// The page's own hints for its user: in words of the device at hand, and only while they are true.

/** Words of controllers, as the core writes its notices, in those of a keyboard. */
const BY_KEYS = [
  [/client silent for ([\d.]+) s; holding/g, "this page was silent for $1 s, so the robot holds: its computer is busy"],
  [/primary button takes/g, "R takes"],
  [/primary button goes on/g, "R goes on"],
  [/controllers have changed places; holding until both grips are let go/g, "the two targets have changed places; holding until G is let go"],
  [/(?:left|right) controller: not tracked/g, "this page does not send where its markers are"],
  [/left controller: /g, "the left ray: "],
  [/right controller: /g, "the right ray: "],
  [/grips let go/g, "G was let go"],
  [/hold a grip to set each/g, "drag each marker, or move it by arrows"],
  [/hold a grip to follow/g, "hold G, and press F meanwhile"],
  [/Pull the trigger again/g, "Press Enter again"],
  [/\brigid target/g, "the mount’s target"],
  [/\btip target/g, "the tip’s target"],
];
/** Words of a keyboard in those of buttons that a finger presses. */
const BY_TOUCH = [
  [/hold G and press Enter to confirm/gi, "hold “Let it move” and tap “Confirm”"],
  [/press Enter to ask for a plan/gi, "tap “Ask for a plan”"],
  [/press Enter\b/gi, "tap “Confirm”"],
  [/Enter asks for a plan/g, "“Ask for a plan” asks for one"],
  [/\bEnter\b/g, "“Confirm”"],
  [/\bR does\b/g, "“Go on” does"],
  [/\bArrows move/g, "Buttons move"],
  [/, or move it by arrows(?: \(.*?\))?/g, ""],
  [/press R for/gi, "tap “Take the offer” for"],
  [/press R\b/gi, "tap “Go on”"],
  [/\bR takes/g, "“Take the offer” takes"],
  [/\bR goes on/g, "“Go on” goes on"],
  [/press F\b/gi, "tap “Follow”"],
  [/\bF, or/g, "“Follow”, or"],
  [/\bH (shows|hides)/g, "“Reach” $1"],
  [/\bG was let go/g, "“Let it move” was let go"],
  [/\bG\b/g, "“Let it move”"],
];

const replaced = (text, pairs) => pairs.reduce((line, [from, to]) => line.replace(from, to), text);

/** `text` of the server for a `device`: "controllers", "keys" or "touch". */
export function ofDevice(text, device) {
  if (device === "controllers") return text;
  const keys = replaced(text, BY_KEYS);
  return device === "touch" ? replaced(keys, BY_TOUCH) : keys;
}

const LET_GO = { controllers: "let go of grips and triggers for a moment", keys: "let go of G and of the mouse for a moment", touch: "let go of “Let it move” and of the picture for a moment" };

/** The next action while the core holds: it waits until nothing is pressed. */
export const whileHolding = (pressed, device) => (pressed ? LET_GO[device] : "wait a moment, aiming begins by itself");

/** Whether the cause of a `notice` that stands while aiming is still there. */
export function lasts(notice, { mode, targets, gripped }) {
  if (mode !== "aim") return true;
  const reaches = [targets?.rigid?.reach, targets?.tip?.reach];
  if (/out of reach/.test(notice)) return reaches.includes("outside");
  if (/target is inside/.test(notice)) return reaches.includes("blocked");
  if (/both targets are needed/.test(notice)) return !targets;
  if (/hold a grip to follow/.test(notice)) return !gripped;
  return true;
}

const ARROWS = new Set(["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown", "PageUp", "PageDown"]);
const ENTER = {
  hold: "Enter asks for a plan once it says “Aiming”.",
  plan: "A plan is already being made: wait for it.",
  preview: "Enter confirms only once the preview has been shown to its end.",
  delay: "It is confirmed already: the robot is about to move.",
  execute: "The robot is moving already.",
  follow: "The robot follows: Enter asks for a plan while aiming.",
  stopped: "The robot is stopped: press R to go on.",
};

/** Why a key does nothing now, "" where it does something. `offers`: whether anything is offered; `cameras`: heard. */
export function whyNothing(code, { up, controls, holder, mode, gripped, offers, cameras }) {
  if (code === "KeyC") return cameras ? "" : "No cameras are heard.";
  const acts = ["Enter", "KeyG", "KeyR", "KeyF"].includes(code) || ARROWS.has(code);
  if (!acts) return "";
  if (!up) return "There is no connection: keys do nothing until it is back.";
  if (!controls) return holder ? "Somebody else controls: press “Ask for control” first." : "You do not control the robot: press “Take control” first.";
  if (code === "Enter") return mode === "ready" && !gripped ? "Hold G, and press Enter while it is held." : (ENTER[mode] ?? "");
  if (mode === "stopped") return code === "KeyR" ? "" : ENTER.stopped;
  if (code === "KeyR") {
    if (!offers) return "R does nothing now: nothing is offered, and nothing is stopped.";
    return gripped ? "Let go of G first, then press R." : "";
  }
  if (code === "KeyF") return mode === "follow" ? "" : mode !== "aim" ? "Following begins while aiming." : gripped ? "" : "Hold G, and press F while it is held.";
  if (ARROWS.has(code) && ["plan", "preview", "ready"].includes(mode)) return "Arrows move targets while aiming; drag a marker to aim anew.";
  if (ARROWS.has(code) && ["delay", "execute"].includes(mode)) return "The targets stay as they are while the robot moves.";
  return "";
}

const SILENT = 0.9; // s without an input that end control at the server, which allows 1 s

/** Why control was lost that was not released: `gap` s between inputs of late, whether the page was `hidden`. */
export function whyLost({ gap, hidden }) {
  const why = hidden
    ? "this page was hidden, and a hidden page cannot hold the robot’s controls"
    : gap > SILENT ? `this page sent nothing for ${gap.toFixed(1)} s, as its computer is too busy` : "the server heard nothing of this page for too long, or has given control away";
  return `Control was lost: ${why}. Press “Take control” to go on.`;
}

const DOUBTFUL = 0.75; // share of futures in which a grasp must hold, else confirming it takes two presses

/** Whether a grasp with this prediction is likely to fail. */
export const isDoubtful = (prediction) => (prediction?.probability ?? 1) < DOUBTFUL;

/** The question at the first press that would confirm a doubtful grasp. */
export const doubtQuestion = (prediction) => `Foreseen to hold in only ${Math.round(100 * prediction.probability)} % of cases. Pull the trigger again to confirm it all the same.`;

/** The result of a motion that has arrived, by the `phases` of its plan, the `objects` as the server has them, and the s in which the arm `settles`. */
export function success(phases, objects, settles) {
  const names = new Set(phases);
  const object = objects.find(({ support }) => support === "held");
  if (object && names.has("lift")) return `Held: lift of ${object.name} is done. Now point where it goes.`;
  if (names.has("release")) return "Put down: the arm has let go. Aim anew for the next motion.";
  return settles > 0 ? "" : "Arrived. Aim anew for the next motion.";
}
