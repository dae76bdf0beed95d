#include "calibrate/eigen.h"

#include "base/check.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#define SWEEPS_MAX 64

// A ← JᵀAJ and V ← VJ with the rotation in the plane of p and q that makes A[p][q] zero.
static void rotate(int n, double a[EIGEN_MAX][EIGEN_MAX], double v[EIGEN_MAX][EIGEN_MAX], int p,
                   int q) {
    double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
    double t = copysign(1, theta) / (fabs(theta) + sqrt(theta * theta + 1));
    double c = 1 / sqrt(t * t + 1), s = t * c;
    for (int k = 0; k < n; k++) {
        double kp = a[k][p], kq = a[k][q];
        a[k][p] = c * kp - s * kq;
        a[k][q] = s * kp + c * kq;
    }
    for (int k = 0; k < n; k++) {
        double pk = a[p][k], qk = a[q][k];
        a[p][k] = c * pk - s * qk;
        a[q][k] = s * pk + c * qk;
        double vp = v[k][p], vq = v[k][q];
        v[k][p] = c * vp - s * vq;
        v[k][q] = s * vp + c * vq;
    }
}

// One pass over all pairs; false once nothing is left to turn.
static bool sweep(int n, double a[EIGEN_MAX][EIGEN_MAX], double v[EIGEN_MAX][EIGEN_MAX]) {
    bool turned = false;
    for (int p = 0; p < n; p++)
        for (int q = p + 1; q < n; q++)
            if (fabs(a[p][q]) > 1e-15 * (fabs(a[p][p]) + fabs(a[q][q]))) {
                rotate(n, a, v, p, q);
                turned = true;
            }
    return turned;
}

void eigen_symmetric(int n, const double matrix[EIGEN_MAX][EIGEN_MAX], struct eigen *out) {
    CHECK(n > 0 && n <= EIGEN_MAX);
    double a[EIGEN_MAX][EIGEN_MAX], v[EIGEN_MAX][EIGEN_MAX] = {{0}};
    memcpy(a, matrix, sizeof a);
    for (int k = 0; k < n; k++)
        v[k][k] = 1;
    for (int i = 0; i < SWEEPS_MAX && sweep(n, a, v); i++)
        ;
    bool taken[EIGEN_MAX] = {false};
    for (int k = 0; k < n; k++) {
        int largest = -1;
        for (int j = 0; j < n; j++)
            if (!taken[j] && (largest < 0 || a[j][j] > a[largest][largest]))
                largest = j;
        taken[largest] = true;
        out->values[k] = a[largest][largest];
        for (int i = 0; i < n; i++)
            out->vectors[k][i] = v[i][largest];
    }
}
