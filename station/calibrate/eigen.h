// Eigenvalues and eigenvectors of small symmetric matrices (Jacobi's rotations).
#pragma once

#define EIGEN_MAX 4

struct eigen {
    double values[EIGEN_MAX];             // falling
    double vectors[EIGEN_MAX][EIGEN_MAX]; // [k] belongs to values[k]; of unit length
};

// The upper left n × n of `matrix`, symmetric and finite; n at most EIGEN_MAX.
void eigen_symmetric(int n, const double matrix[EIGEN_MAX][EIGEN_MAX], struct eigen *out);
