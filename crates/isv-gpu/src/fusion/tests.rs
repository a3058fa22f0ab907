//! Fusion on the GPU against fusion on the CPU.
