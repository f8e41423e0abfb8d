// Written by `python -m upkeep.wire_table` from trunkline/ar/session/binary.py and messages.py; do not edit.
export const VERSION = 1;
export const HEAD = {
  "type": {
    "type": "u8",
    "offset": 0
  },
  "flags": {
    "type": "u8",
    "offset": 1
  },
  "count": {
    "type": "u16",
    "offset": 2
  },
  "sequence": {
    "type": "u32",
    "offset": 4
  },
  "time": {
    "type": "f64",
    "offset": 8
  }
};
export const HEAD_BYTES = 16;
export const INPUT_BYTES = 128;
export const POSE = ["x", "y", "z", "qw", "qx", "qy", "qz"];
export const HAND = ["x", "y", "z", "qw", "qx", "qy", "qz", "trigger", "grip", "stick_x", "stick_y", "stick_pressed", "primary", "secondary"];
export const POINT = ["x", "y", "z"];
export const HANDS = ["left", "right"];
export const MARKERS = ["left_ray", "right_ray", "rigid_target", "tip_target"];
export const FROM_SERVER = {
  "robot": {
    "type": 1,
    "row": [
      "x",
      "y",
      "z",
      "qw",
      "qx",
      "qy",
      "qz"
    ],
    "flags": {
      "moving": 1,
      "stopped": 2,
      "stale": 4
    }
  },
  "preview": {
    "type": 2,
    "row": [
      "x",
      "y",
      "z",
      "qw",
      "qx",
      "qy",
      "qz"
    ],
    "flags": {
      "last": 1
    }
  },
  "shell": {
    "type": 3,
    "row": [
      "x",
      "y",
      "z"
    ],
    "flags": {}
  }
};
export const FROM_CLIENT = {
  "input": {
    "type": 16,
    "row": [
      "x",
      "y",
      "z",
      "qw",
      "qx",
      "qy",
      "qz",
      "trigger",
      "grip",
      "stick_x",
      "stick_y",
      "stick_pressed",
      "primary",
      "secondary"
    ],
    "flags": {
      "left_tracked": 1,
      "right_tracked": 2,
      "visible": 4,
      "drawn": 8,
      "correct": 16
    }
  },
  "view": {
    "type": 19,
    "row": [
      "x",
      "y",
      "z",
      "qw",
      "qx",
      "qy",
      "qz"
    ],
    "flags": {
      "tracked": 1
    }
  },
  "ack": {
    "type": 17,
    "row": [],
    "flags": {}
  },
  "stop": {
    "type": 18,
    "row": [],
    "flags": {}
  }
};
export const CLIENT_MESSAGES = {
  "hello": {
    "version": "required",
    "token": "",
    "code": "",
    "key": "",
    "name": "",
    "space": "base",
    "type": "hello"
  },
  "pong": {
    "number": "required",
    "stamp": "required",
    "type": "pong"
  },
  "lease": {
    "action": "required",
    "to": "",
    "type": "lease"
  },
  "alignment": {
    "pose": "required",
    "type": "alignment"
  },
  "touch": {
    "type": "touch"
  },
  "anchor": {
    "id": "required",
    "pose": "required",
    "type": "anchor"
  },
  "shown": {
    "digest": "required",
    "type": "shown"
  }
};
export const SERVER_MESSAGES = {
  "welcome": {
    "id": "required",
    "key": "required",
    "token": "required",
    "package": "required",
    "rate": "required",
    "version": 1,
    "type": "welcome"
  },
  "error": {
    "reason": "required",
    "closing": false,
    "type": "error"
  },
  "ping": {
    "number": "required",
    "type": "ping"
  },
  "clock": {
    "offset": "required",
    "round_trip": "required",
    "type": "clock"
  },
  "lease": {
    "holder": "required",
    "asking": [],
    "clients": [],
    "type": "lease"
  },
  "aligning": {
    "step": "required",
    "next": "required",
    "said": "required",
    "place": "required",
    "expected": "required",
    "residual": "required",
    "anchor": "required",
    "fasten": "required",
    "type": "aligning"
  },
  "state": {
    "mode": "required",
    "motion": "required",
    "notice": "required",
    "next": "required",
    "keys": "required",
    "countdown": "required",
    "preview": "required",
    "execute": "required",
    "targets": "required",
    "robot": "required",
    "fault": "required",
    "correction": "",
    "type": "state"
  },
  "preview": {
    "digest": "required",
    "step": "required",
    "duration": "required",
    "begins": "required",
    "phases": "required",
    "correction": null,
    "uncorrected": "",
    "type": "preview"
  },
  "foreseen": {
    "digest": "required",
    "probability": "required",
    "low": "required",
    "high": "required",
    "times": "required",
    "tip": "required",
    "spread": "required",
    "within": "required",
    "futures": "required",
    "miss": null,
    "unknown": "",
    "offer": null,
    "type": "foreseen"
  },
  "measured": {
    "markers": "required",
    "tip": "required",
    "apart": "required",
    "age": "required",
    "rate": "required",
    "loss": "required",
    "fault": "required",
    "from_preview": null,
    "radius": null,
    "frame": "",
    "type": "measured"
  },
  "world": {
    "world": "required",
    "type": "world"
  }
};
