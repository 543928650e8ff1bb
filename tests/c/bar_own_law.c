/* Finite differences for a bar whose stress has a part that relaxes: an own solver, driven by a body force that a table has. */
#include "mmsmith/bar_own_law.h"
#include <stdio.h>
#include <stdlib.h>

int main(int count, char **argument)
{
    enum { MOST = 1024 };
    const int n = count > 2 ? atoi(argument[1]) : 16;
    bar_own_law_parameters own = bar_own_law_defaults();
    bar_own_law_solution bar;
    double X[MOST + 1], u[MOST + 1], v[MOST + 1], strain[MOST], q[MOST], P[MOST], b, dX = 1.0 / n, dt = 0.005 / (10 * n);
    const char *message = bar_own_law_prepare(&bar, &own);
    int i, step, steps = 10 * n;
    if (!message && count > 2)
        message = bar_own_law_read_table(&bar, argument[2]);
    if (message || n < 2 || n > MOST) {
        fprintf(stderr, "%s\n", message ? message : "between 2 and 1024 cells");
        return 1;
    }
    for (i = 0; i <= n; ++i) {
        X[i] = i * dX;
        bar_own_law_u(&bar, &X[i], 0.0, &u[i]);
        bar_own_law_v(&bar, &X[i], -dt / 2, &v[i]); /* half a step before: central differences */
    }
    for (i = 0; i < n; ++i)
        strain[i] = q[i] = 0.0;
    printf("t,X,ux\n");
    for (step = 0; step <= steps; ++step) {
        for (i = 0; i < n; ++i) {
            const double F = 1.0 + (u[i + 1] - u[i]) / dX, now = log(F);
            if (step > 0)
                q[i] += (1.0 - exp(-dt / own.tau)) * (0.5 * (strain[i] + now) - q[i]);
            strain[i] = now;
            P[i] = (own.E * now + own.G * (now - q[i])) / F;
        }
        if (step % n == 0)
            for (i = 1; i < n; ++i)
                printf("%.17g,%.17g,%.17g\n", step * dt, X[i], u[i]);
        for (i = 1; i < n; ++i) {
            bar_own_law_b(&bar, &X[i], step * dt, &b);
            v[i] += dt * ((P[i] - P[i - 1]) / dX / own.rho0 + b);
        }
        for (i = 1; i < n; ++i)
            u[i] += dt * v[i];
    }
    return 0;
}
