"""The stand-in lab."""

from trunkline.startup_notice import say_loading

say_loading("demo")
