/* What exact.py needs of a generated header, as a shared library. The solution's name comes from the compiler's command
 * line: cc -shared -fPIC -ffp-contract=off -D'HEADER="mmsmith/swirl.h"' -DNAME=swirl ... */
#include HEADER

#define JOIN_(a, b) a##_##b
#define JOIN(a, b) JOIN_(a, b)
#define SOLUTION(what) JOIN(NAME, what)

static SOLUTION(solution) solution;

/* A null pointer, or what is wrong with the parameters. */
const char *prepare(double A)
{
    SOLUTION(parameters) parameters = SOLUTION(defaults)();
    parameters.A = A;
    return SOLUTION(prepare)(&solution, &parameters);
}

/* Density, period, wave speed, Young's modulus, Poisson's ratio. */
void constants(double *out)
{
    const double lambda = SOLUTION(lambda)(&solution), mu = SOLUTION(mu)(&solution);
    out[0] = SOLUTION(density)(&solution);
    out[1] = SOLUTION(period)(&solution);
    out[2] = SOLUTION(wave_speed)(&solution);
    out[3] = mu * (3 * lambda + 2 * mu) / (lambda + mu);
    out[4] = lambda / (2 * (lambda + mu));
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

/* The state at n reference positions: for the start, never to measure errors by. */
void start(size_t n, const double *X, double *u, double *v, double *a, double *F)
{
    size_t p;
    for (p = 0; p < n; ++p) {
        SOLUTION(u)(&solution, X + 2 * p, 0, u + 2 * p);
        SOLUTION(v)(&solution, X + 2 * p, 0, v + 2 * p);
        SOLUTION(a)(&solution, X + 2 * p, 0, a + 2 * p);
        SOLUTION(F)(&solution, X + 2 * p, 0, F + 4 * p);
    }
}
