/* What solve.py needs of a generated header, as a shared library. The solution's name comes from the compiler's command
 * line: cc -shared -fPIC -ffp-contract=off -D'HEADER="mmsmith/ring.h"' -DNAME=ring ... */
#include HEADER

#define JOIN_(a, b) a##_##b
#define JOIN(a, b) JOIN_(a, b)
#define SOLUTION(what) JOIN(NAME, what)

static SOLUTION(solution) solution;

/* A null pointer, or what is wrong with the parameters. */
const char *prepare(void)
{
    SOLUTION(parameters) parameters = SOLUTION(defaults)();
    return SOLUTION(prepare)(&solution, &parameters);
}

/* lambda, mu, density, inner radius, outer radius, period, wave speed, cell length. */
void constants(double *out)
{
    out[0] = SOLUTION(lambda)(&solution);
    out[1] = SOLUTION(mu)(&solution);
    out[2] = SOLUTION(density)(&solution);
    out[3] = SOLUTION(inner)(&solution);
    out[4] = SOLUTION(outer)(&solution);
    out[5] = SOLUTION(period)(&solution);
    out[6] = SOLUTION(wave_speed)(&solution);
    out[7] = SOLUTION(cell_length)(&solution);
}

size_t point_count(void)
{
    return SOLUTION(point_count);
}

/* What is kept of n reference positions, for body_force. */
void points(size_t n, const double *X, double *point)
{
    SOLUTION(point_array)(&solution, n, X, point);
}

/* The body force per unit mass at these positions. */
void body_force(double t, size_t n, const double *point, double *b)
{
    SOLUTION(b_array)(&solution, t, n, point, 0, n, b);
}

/* Displacement and velocity at n reference positions: for initial and prescribed values, never to measure errors by. */
void motion(double t, size_t n, const double *X, double *u, double *v)
{
    size_t p;
    for (p = 0; p < n; ++p) {
        SOLUTION(u)(&solution, X + 2 * p, t, u + 2 * p);
        SOLUTION(v)(&solution, X + 2 * p, t, v + 2 * p);
    }
}
