"""Pages on which a model runs: its kernels as WebAssembly, its arrays as one image of memory."""
