"""What LeRobot's loader reads of a dataset, with chunks of future actions, as JSON on standard output.

It runs in an environment without Trunkline: releases 0.4 to 0.6 need an older PyTorch, from 0.5 on also an older NumPy
and a newer Python. The tests compare what it prints, frame by frame, and skip it without LEROBOT_PYTHON:

    python -m venv lerobot && lerobot/bin/pip install lerobot==0.4.4
    LEROBOT_PYTHON=$PWD/lerobot/bin/python python -m pytest tests/ar/dataset
"""
# pyright: reportMissingImports=false

import json
import sys

from lerobot.datasets.lerobot_dataset import LeRobotDataset

CHUNK = 4  # frames of actions that a policy would ask for

dataset = LeRobotDataset("any/name", root=sys.argv[1])
ahead = {"action": [step / dataset.fps for step in range(CHUNK)]}
chunks = LeRobotDataset("any/name", root=sys.argv[1], delta_timestamps=ahead)
frames = [{k: v.tolist() if hasattr(v, "tolist") else v for k, v in dataset[n].items()} for n in range(len(dataset))]
summary = {
    "episodes": dataset.num_episodes,
    "fps": dataset.fps,
    "features": {name: list(feature["shape"]) for name, feature in dataset.features.items()},
    "stats": {name: feature["mean"].tolist() for name, feature in dataset.meta.stats.items()},
    "frames": frames,
    "chunks": [chunks[n]["action"].tolist() for n in range(len(chunks))],
    "padded": [chunks[n]["action_is_pad"].tolist() for n in range(len(chunks))],
}
print(json.dumps(summary))
