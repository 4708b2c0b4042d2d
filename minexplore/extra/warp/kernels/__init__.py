"""The kernels of the environment on a device."""
