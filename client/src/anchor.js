// One anchor at the robot's base, which the headset keeps from one session to the next; the server identifies it by its id.

import { Quaternion, Vector3 } from "three";

/** Fastens `base`, its pose in the room, to the room: `{id, anchor}`; null where the headset has no anchors. */
export async function fasten(frame, space, { position: p, quaternion: q }) {
  if (!frame.createAnchor) return null;
  const pose = new XRRigidTransform({ x: p.x, y: p.y, z: p.z }, { x: q.x, y: q.y, z: q.z, w: q.w });
  const anchor = await frame.createAnchor(pose, space);
  const id = await anchor.requestPersistentHandle?.().catch(() => null);
  return { id: id ?? crypto.randomUUID(), anchor }; // without a handle it lasts for this session
}

/** The anchor `id` of a session before; null where the headset has lost it. */
export async function restore(session, id) {
  try {
    return { id, anchor: await session.restorePersistentAnchor(id) };
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
