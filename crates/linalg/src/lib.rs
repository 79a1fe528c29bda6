//! Dense kernels and factors for small matrices, and those with the zeros of a tree. It knows no robot.
