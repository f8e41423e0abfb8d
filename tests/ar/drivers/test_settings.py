"""The settings of real machines: conf/execution, and files of the release before."""


from trunkline.ar.drivers.settings import read_execution_config
from trunkline.pipeline.config import PROJECT

TEXT = (PROJECT / "conf/execution/config.yaml").read_text(encoding="utf-8")


def test_the_key_of_the_release_before_is_read_and_named(tmp_path, capsys):
    (tmp_path / "config.yaml").write_text(TEXT.replace("\npanda:", "\narm:"), encoding="utf-8")
    assert read_execution_config(tmp_path) == read_execution_config()
    expected = f"{tmp_path}: `arm` is called `panda` now: please rename it, the next release reads `panda` alone\n"
    assert capsys.readouterr().out == expected
