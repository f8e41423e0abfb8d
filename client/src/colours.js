// Okabe and Ito's colours, distinguishable to the colour-blind. What a colour means, a shape or a word shows as well.

export const MOUNT = 0x56b4e9; // sky blue: the mount's target
export const TIP = 0xe69f00; // orange: the tip's
export const OFFER = 0x009e73; // bluish green: what is offered, what may go
export const GHOST = 0xf0e442; // yellow: the preview
export const WRONG = 0xd55e00; // vermilion: out of reach, blocked, stopped
export const REACH = 0xcc79a7; // reddish purple: the tip's reach
export const BACK = { dark: 0x1d2329, light: 0xe9edf1 };

/** As CSS writes it. */
export const css = (colour) => `#${colour.toString(16).padStart(6, "0")}`;
