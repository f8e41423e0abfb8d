// One anchor at the robot's base, kept by the headset from one session to the next.

import { Quaternion, Vector3 } from "three";

const KEY = "trunkline.base"; // of an origin's storage: anchors of another port or address are others

/** Fastens `base`, its pose in the room, to the room; null where the headset has no anchors. */
export async function fasten(frame, space, { position: p, quaternion: q }) {
  if (!frame.createAnchor) return null;
  const pose = new XRRigidTransform({ x: p.x, y: p.y, z: p.z }, { x: q.x, y: q.y, z: q.z, w: q.w });
  const anchor = await frame.createAnchor(pose, space);
  try {
    const handle = await anchor.requestPersistentHandle?.();
    if (handle) localStorage.setItem(KEY, JSON.stringify({ handle, date: new Date().toISOString() }));
  } catch {
    localStorage.removeItem(KEY); // it lasts for this session
  }
  return anchor;
}

/** The anchor of the session before; null where there is none, or the headset has lost it. */
export async function restore(session) {
  const kept = localStorage.getItem(KEY);
  if (!kept || !session.restorePersistentAnchor) return null;
  try {
    return await session.restorePersistentAnchor(JSON.parse(kept).handle);
  } catch {
    return null; // Quest throws where the room is not recognised
  }
}

/** Where an anchor is now; null while it is lost. */
export function placeOf(frame, space, anchor) {
  if (frame.trackedAnchors && !frame.trackedAnchors.has(anchor)) return null;
  const pose = frame.getPose(anchor.anchorSpace, space);
  if (!pose) return null;
  const { position: p, orientation: q } = pose.transform;
  return { position: new Vector3(p.x, p.y, p.z), quaternion: new Quaternion(q.x, q.y, q.z, q.w) };
}
