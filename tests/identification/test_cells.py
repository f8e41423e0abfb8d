"""Cells of tables for people."""

import numpy as np
import pytest

from trunkline.identification.evaluation.error_tables import LABELS, REFERENCES, TABLED, number, pair


@pytest.mark.parametrize(
    ("value", "digits", "cell"),
    [(12.345, 3, "12.3"), (12.346, 4, "12.35"), (0.0, 3, "0"), (1234.5, 3, "1.23e+03"),
     (None, 3, "–"), (np.nan, 4, "–")],
)  # fmt: skip
def test_a_number_has_so_many_digits_that_count(value, digits, cell):
    assert number(value, digits) == cell


def test_a_pair_is_there_where_its_position_is():
    assert pair(1.0, 2.5) == "1 / 2.5"
    assert pair(1.0, None) == "1 / –"
    assert pair(None, 2.5) == "–"


def test_every_model_of_a_table_has_its_words():
    assert {*TABLED, *REFERENCES} <= set(LABELS)
