"""The cache of compiled kernels on disk.

Numba's own cache knows a kernel by the file that it stands in, and does not see a change of a function that the kernel
calls, nor of a constant that it uses. Here the name of a cached kernel is a hash of all that it is compiled from
(`digest`), in a folder whose name is a hash of what compiles it (`identity`): a change gives another name, and what was
compiled before the change is found again once it is undone. The files lie in the user's cache folder (`storage`).
"""

from clothsim.base.kernel_cache.cache import KernelCache, cached_kernels, can_store, is_cached
from clothsim.base.kernel_cache.pipelines import KernelCompiler, PartCompiler

__all__ = ["KernelCache", "KernelCompiler", "PartCompiler", "cached_kernels", "can_store", "is_cached"]
