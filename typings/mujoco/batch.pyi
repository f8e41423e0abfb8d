# MuJoCo's Python package is compiled and has no stubs: whatever it holds is of any type.
from typing import Any

def __getattr__(name: str) -> Any: ...
