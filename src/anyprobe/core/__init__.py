"""Arrays by their shapes, for type checkers alone: `Float[np.ndarray, "H 2*H 3"]`."""

from typing import TYPE_CHECKING, Any

__all__ = ["Bool", "Float", "Float16", "Int", "UInt8"]

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Float16, Int, UInt8
else:
    Bool = Float = Float16 = Int = UInt8 = Any
