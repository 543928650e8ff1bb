/* Finite differences for a bar between two walls: an own solver, driven by the exact body force. */
#include "mmsmith/axis_aligned_1d.h"
#include <stdio.h>
#include <stdlib.h>

int main(int count, char **argument)
{
    enum { MOST = 1024 };
    const int n = count > 1 ? atoi(argument[1]) : 16;
    axis_aligned_1d_parameters parameters = axis_aligned_1d_defaults();
    axis_aligned_1d_solution bar;
    double X[MOST + 1], u[MOST + 1], v[MOST + 1], P[MOST], b, dX = 1.0 / n, dt = 0.2 * dX / 50.0;
    const char *message = axis_aligned_1d_prepare(&bar, &parameters);
    int i, step, steps = 10 * n;
    if (message || n < 2 || n > MOST) {
        fprintf(stderr, "%s\n", message ? message : "between 2 and 1024 cells");
        return 1;
    }
    for (i = 0; i <= n; ++i) {
        X[i] = i * dX;
        axis_aligned_1d_u(&bar, &X[i], 0.0, &u[i]);
        axis_aligned_1d_v(&bar, &X[i], -dt / 2, &v[i]); /* half a step before: central differences */
    }
    printf("t,X,ux,F11\n");
    for (step = 0; step <= steps; ++step) {
        const double lambda = axis_aligned_1d_lambda(&bar), mu = axis_aligned_1d_mu(&bar);
        for (i = 0; i < n; ++i) {
            const double F = 1.0 + (u[i + 1] - u[i]) / dX;
            P[i] = (lambda * log(F) + mu * (F * F - 1.0)) / F;
        }
        if (step % n == 0) {
            for (i = 1; i < n; ++i)
                printf("%.17g,%.17g,%.17g,%.17g\n", step * dt, X[i], u[i], 1.0 + (u[i + 1] - u[i - 1]) / (2 * dX));
        }
        for (i = 1; i < n; ++i) {
            axis_aligned_1d_b(&bar, &X[i], step * dt, &b);
            v[i] += dt * ((P[i] - P[i - 1]) / dX / axis_aligned_1d_density(&bar) + b);
        }
        for (i = 1; i < n; ++i)
            u[i] += dt * v[i];
    }
    return 0;
}
