// Cividis (Nunez, Anderton, Renslow 2018): dark to light for every eye, of any kind of colour blindness.

const STOPS = [[0, 34, 78], [40, 67, 110], [87, 93, 109], [125, 124, 120], [165, 156, 116], [210, 193, 99], [254, 232, 56]];

/** Red, green and blue from 0 to 1 of a share from 0 to 1; white for no number. */
export function cividis(share) {
  if (!Number.isFinite(share)) return [1, 1, 1];
  const at = Math.min(Math.max(share, 0), 1) * (STOPS.length - 1);
  const low = Math.min(Math.floor(at), STOPS.length - 2);
  return STOPS[low].map((value, k) => (value + (at - low) * (STOPS[low + 1][k] - value)) / 255);
}

/** As a background of CSS, from left to right. */
export const gradient = () => `linear-gradient(to right, ${STOPS.map((rgb) => `rgb(${rgb})`).join(", ")})`;
