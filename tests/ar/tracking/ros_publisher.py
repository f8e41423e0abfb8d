"""A driver of cameras in another process: three bodies of an arm by DDS, as a package of ROS 2 publishes them.

    python -m tests.ar.tracking.ros_publisher DOMAIN MESSAGE RELIABILITY FAULT

It prints a line once it publishes. FAULT begins with the signal USR1: old (stamps stand still), back (stamps go back),
frozen, swapped, off (a body 0.5 m elsewhere), nan, frame (a body in another frame); "" for none. `missing`, a body
less, is so from the first message on.
"""

import math
import signal
import sys
import time

import numpy as np
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.topic import Topic

from trunkline.ar.drivers.ros_messages import Header, Time
from trunkline.ar.tracking import ros_messages as ros

NAMES = ("base", "middle", "tip")
PLACES = np.array([[1.0, 2.0, 3.0], [1.0, 2.0, 2.8], [1.1, 2.0, 2.6]])
TURNED = (2 / 11, 1 / 11, -4 / 11, 10 / 11)  # wxyz, each another number
TOPICS = {"geometry_msgs/PoseStamped": "/poses/{body}", "tf2_msgs/TFMessage": "/tf"}
RATE = 120.0


def topic_of(message):
    return TOPICS.get(message, "/rigid_bodies")


def header(stamp, frame):
    fraction, whole = math.modf(stamp)
    return Header(Time(int(whole), int(1e9 * fraction)), frame)


def pose(place):
    w, x, y, z = TURNED
    return ros.RosPose(ros.Point(*place), ros.Quaternion(x, y, z, w))


def messages(kind, number, stamp, names, places, frames):
    """(body or None, message) of a frame."""
    heads = [header(stamp, frame) for frame in frames]
    bodies = list(zip(names, [pose(place.tolist()) for place in places], strict=True))
    if kind == "geometry_msgs/PoseStamped":
        return [(name, ros.PoseStamped(head, at)) for head, (name, at) in zip(heads, bodies, strict=True)]
    if kind == "tf2_msgs/TFMessage":
        parts = [ros.Transform(ros.Vector3(*place.tolist()), at.orientation)
                 for place, (_, at) in zip(places, bodies, strict=True)]  # fmt: skip
        rows = [ros.TransformStamped(*row) for row in zip(heads, names, parts, strict=True)]
        return [(None, ros.TFMessage(rows))]
    if "NamedPose" in kind:
        named, latency = [ros.NamedPose(*body) for body in bodies], [ros.LatencyInfo("cameras", 5)]
        more = (7, latency) if kind.endswith("V2") else ()
        return [(None, ros.TYPES[kind](heads[0], *more, named))]
    marker = ros.RosMarker(0, 1, "m", ros.Point(0.0, 0.0, 0.0))
    rows = [ros.RigidBody(name, [marker], at) for name, at in bodies]
    return [(None, ros.TYPES[kind](heads[0], number, rows))]


def main(domain, kind, reliability, fault):
    begins = []
    signal.signal(signal.SIGUSR1, lambda *_: begins.append(time.time()))
    quality = {"reliable": Policy.Reliability.Reliable(0), "best_effort": Policy.Reliability.BestEffort}[reliability]
    participant, qos = DomainParticipant(int(domain)), Qos(quality, Policy.History.KeepLast(10))
    bodies = NAMES if kind == "geometry_msgs/PoseStamped" else [None]
    topics = {body: f"rt{topic_of(kind).replace('{body}', body or '')}" for body in bodies}
    writers = {
        body: DataWriter(participant, Topic(participant, topic, ros.TYPES[kind]), qos) for body, topic in topics.items()
    }
    rng, number, last = np.random.default_rng(0), 0, None
    print("publishes", flush=True)
    while True:
        number += 1
        faulty = fault if begins else ""
        stamp, places, names = time.time(), PLACES + 3e-4 * rng.standard_normal((3, 3)), list(NAMES)
        frames = ["world"] * 3
        if faulty == "old":
            stamp = begins[0]
        elif faulty == "back":
            stamp -= 1000.0 + number
        elif faulty == "frozen":
            places = last if last is not None else places
            last = places
        elif faulty == "swapped":
            places[[1, 2]] = places[[2, 1]]
        elif faulty == "off":
            places[2, 0] += 0.5
        elif faulty == "nan":
            places[2] = np.nan
        elif faulty == "frame":
            frames[2] = "elsewhere"
        if fault == "missing":
            names, places, frames = names[:2], places[:2], frames[:2]
        for body, message in messages(kind, number, stamp, names, places, frames):
            writers[body].write(message)
        time.sleep(1 / RATE)


if __name__ == "__main__":
    main(*sys.argv[1:])
