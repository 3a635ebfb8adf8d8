"""One box against four that lie side by side, by vector instructions: a compiler left alone compares one by one."""

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from clothsim.contact.bvh import FOUR

_FLOATS = ir.VectorType(ir.DoubleType(), FOUR)
_SAME = ir.Constant(ir.VectorType(ir.IntType(32), FOUR), [0] * FOUR)


@intrinsic
def that_overlap(context: Any, boxes: Any, four: Any, a: Any, b: Any, c: Any, d: Any, e: Any, f: Any) -> Any:
    """Which boxes of a four in `boxes` (g, 6, 4) overlap the one with the corners (a, b, c) and (d, e, f).

    An integer with bit k for box k. Overlap is closed; NaN overlaps nothing. four: its number, not negative.
    """

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, args[0])
        start = builder.mul(args[1], ir.Constant(ir.IntType(64), 6 * FOUR))
        overlap = ir.Constant(ir.VectorType(ir.IntType(1), FOUR), [1] * FOUR)
        for side in range(6):
            place = builder.add(start, ir.Constant(ir.IntType(64), side * FOUR))
            theirs = builder.load(builder.bitcast(builder.gep(array.data, [place]), _FLOATS.as_pointer()), align=8)
            opposite = args[2 + (side + 3) % 6]
            nothing = ir.Constant(_FLOATS, ir.Undefined)
            one = builder.insert_element(nothing, opposite, ir.Constant(ir.IntType(32), 0))
            mine = builder.shuffle_vector(one, nothing, _SAME)
            low, high = (theirs, mine) if side < 3 else (mine, theirs)
            overlap = builder.and_(overlap, builder.fcmp_ordered("<=", low, high))
        return builder.zext(builder.bitcast(overlap, ir.IntType(FOUR)), ir.IntType(64))

    return types.int64(boxes, types.int64, *6 * [types.float64]), generate
