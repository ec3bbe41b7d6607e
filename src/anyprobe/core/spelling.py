"""The known name that was meant by an unknown one."""

from collections.abc import Iterable
from difflib import get_close_matches

LEAST_LIKENESS = 0.75
"""Smallest difflib ratio of a name that may be meant: golden is like gold (0.80), not like molybdenum (0.63)."""
MOST = 2
"""Most names that are proposed."""
LEAST_PART = 3
"""Fewest letters that stand for a name that contains them."""


def did_you_mean(name: object, known: Iterable[str]) -> str:
    """Return "; did you mean gold?" with up to two known names that are like an unknown one or contain it, in any case;
    "" without any."""
    key, names = str(name).strip().lower(), {one.lower(): one for one in known}
    alike = get_close_matches(key, names, n=MOST, cutoff=LEAST_LIKENESS)
    alike = alike or [one for one in names if key in one and len(key) >= LEAST_PART][:MOST]
    return f"; did you mean {' or '.join(names[one] for one in alike)}?" if alike else ""
