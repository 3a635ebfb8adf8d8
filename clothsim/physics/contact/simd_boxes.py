"""SIMD overlap test of one box against the four boxes of a BVH node.

Written as vector instructions: LLVM's own vectoriser leaves the comparisons scalar.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from clothsim.physics.contact.bvh import WIDTH

_FLOATS = ir.VectorType(ir.DoubleType(), WIDTH)
_SAME = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH)


@intrinsic
def overlap_mask(context: Any, boxes: Any, node: Any, a: Any, b: Any, c: Any, d: Any, e: Any, f: Any) -> Any:
    """Bit mask of the boxes of a node in `boxes` (g, 6, 4) that overlap the box (a, b, c), (d, e, f).

    Bit k is for box k. Overlap is closed; NaN overlaps nothing. node: its index, not negative.
    """

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, args[0])
        start = builder.mul(args[1], ir.Constant(ir.IntType(64), 6 * WIDTH))
        overlap = ir.Constant(ir.VectorType(ir.IntType(1), WIDTH), [1] * WIDTH)
        for side in range(6):
            address = builder.add(start, ir.Constant(ir.IntType(64), side * WIDTH))
            stored = builder.load(builder.bitcast(builder.gep(array.data, [address]), _FLOATS.as_pointer()), align=8)
            opposite = args[2 + (side + 3) % 6]
            nothing = ir.Constant(_FLOATS, ir.Undefined)
            one = builder.insert_element(nothing, opposite, ir.Constant(ir.IntType(32), 0))
            query = builder.shuffle_vector(one, nothing, _SAME)
            low, high = (stored, query) if side < 3 else (query, stored)
            overlap = builder.and_(overlap, builder.fcmp_ordered("<=", low, high))
        return builder.zext(builder.bitcast(overlap, ir.IntType(WIDTH)), ir.IntType(64))

    return types.int64(boxes, types.int64, *6 * [types.float64]), generate
