/* Evaluates the generated headers at the points that come in, and writes every value as the bits of a double.
 *
 * A case is the name of a solution, its parameters, a time, the number of points, and their coordinates. The answer is
 * a line "refused MESSAGE", or "values" and the bits: defaults, constants, measures of the domain, then for each point
 * u, v, a, H, F, J, P, b from one function each, the same from one call, the strain energy where there is one, the
 * tractions, b in stages, and b from the array. headers.h includes the headers and defines SOLUTIONS, a list of what each offers:
 * SOLUTION(name, BOX or ANNULUS, ENERGY or NO_ENERGY), CONSTANTS_name, a list of WRITE_CONSTANT(name, constant) for those of its
 * law, and TRACTIONS_name, a list of WRITE_TRACTION(name, surface).
 */
#include "headers.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static double read_double(void)
{
    unsigned long long bits;
    double x;
    if (scanf("%llx", &bits) != 1) {
        fputs("a number is missing\n", stderr);
        exit(2);
    }
    memcpy(&x, &bits, sizeof x);
    return x;
}

static void write_doubles(const double *x, size_t n)
{
    size_t i;
    for (i = 0; i < n; ++i) {
        unsigned long long bits;
        memcpy(&bits, x + i, sizeof bits);
        printf(" %llx", bits);
    }
}

static void write_double(double x)
{
    write_doubles(&x, 1);
}

static double *numbers(size_t n)
{
    double *x = (double *)malloc((n + 1) * sizeof *x);
    if (x == 0) {
        fputs("out of memory\n", stderr);
        exit(2);
    }
    return x;
}

#define WRITE_BOX(name)                                                                            \
    {                                                                                              \
        double corner[name##_dimension];                                                           \
        name##_lower(&s, corner);                                                                  \
        write_doubles(corner, d);                                                                  \
        name##_upper(&s, corner);                                                                  \
        write_doubles(corner, d);                                                                  \
    }

#define WRITE_ANNULUS(name)                                                                        \
    write_double(name##_inner(&s));                                                                \
    write_double(name##_outer(&s));

#define WRITE_CONSTANT(name, constant) write_double(name##_##constant(&s));

#define WRITE_ENERGY(name) write_double(name##_W(&s, Xp, t));

#define WRITE_NO_ENERGY(name)

#define WRITE_TRACTION(name, surface)                                                              \
    name##_##surface##_traction(&s, Xp, t, vector);                                                \
    write_doubles(vector, d);

#define SOLUTION(name, domain, energy)                                                             \
    static void run_##name(void)                                                                   \
    {                                                                                              \
        const size_t d = name##_dimension;                                                         \
        double values[name##_parameter_count + 1];                                                 \
        name##_parameters parameters = name##_defaults();                                          \
        name##_solution s;                                                                         \
        const char *message;                                                                       \
        double t, *X, *point, *b;                                                                  \
        unsigned long n, p;                                                                        \
        size_t i;                                                                                  \
        name##_time_values time;                                                                   \
        for (i = 0; i < name##_parameter_count; ++i) {                                             \
            values[i] = read_double();                                                             \
        }                                                                                          \
        t = read_double();                                                                         \
        if (scanf("%lu", &n) != 1) {                                                               \
            exit(2);                                                                               \
        }                                                                                          \
        X = numbers(n * d);                                                                        \
        point = numbers(n * name##_point_count);                                                   \
        b = numbers(n * d);                                                                        \
        for (i = 0; i < n * d; ++i) {                                                              \
            X[i] = read_double();                                                                  \
        }                                                                                          \
        if (name##_parameter_count > 0) {                                                          \
            double defaults[name##_parameter_count + 1];                                           \
            memcpy(defaults, &parameters, name##_parameter_count * sizeof(double));                \
            memcpy(&parameters, values, name##_parameter_count * sizeof(double));                  \
            memcpy(values, defaults, name##_parameter_count * sizeof(double));                     \
        }                                                                                          \
        message = name##_prepare(&s, &parameters);                                                 \
        if (message != 0) {                                                                        \
            printf("refused %s\n", message);                                                       \
        } else {                                                                                   \
            printf("values");                                                                      \
            write_doubles(values, name##_parameter_count);                                         \
            write_double(name##_cell_length(&s));                                                  \
            write_double(name##_density(&s));                                                      \
            write_double(name##_wave_speed(&s));                                                   \
            write_double(name##_period(&s));                                                       \
            CONSTANTS_##name                                                                       \
            WRITE_##domain(name)                                                                   \
            name##_point_array(&s, n, X, point);                                                   \
            /* In two parts, as threads would. */                                                  \
            name##_b_array(&s, t, n, point, 0, n / 3, b);                                          \
            name##_b_array(&s, t, n, point, n / 3, n - n / 3, b);                                  \
            time = name##_at_time(&s, t);                                                          \
            for (p = 0; p < n; ++p) {                                                              \
                const double *Xp = X + p * d;                                                      \
                double vector[name##_dimension], matrix[name##_dimension * name##_dimension];      \
                double kept[name##_point_count + 1];                                               \
                name##_field_values all;                                                           \
                name##_u(&s, Xp, t, vector);                                                       \
                write_doubles(vector, d);                                                          \
                name##_v(&s, Xp, t, vector);                                                       \
                write_doubles(vector, d);                                                          \
                name##_a(&s, Xp, t, vector);                                                       \
                write_doubles(vector, d);                                                          \
                name##_H(&s, Xp, t, matrix);                                                       \
                write_doubles(matrix, d * d);                                                      \
                name##_F(&s, Xp, t, matrix);                                                       \
                write_doubles(matrix, d * d);                                                      \
                write_double(name##_J(&s, Xp, t));                                                 \
                name##_P(&s, Xp, t, matrix);                                                       \
                write_doubles(matrix, d * d);                                                      \
                name##_b(&s, Xp, t, vector);                                                       \
                write_doubles(vector, d);                                                          \
                name##_fields(&s, Xp, t, &all);                                                    \
                write_doubles(all.u, d);                                                           \
                write_doubles(all.v, d);                                                           \
                write_doubles(all.a, d);                                                           \
                write_doubles(all.H, d * d);                                                       \
                write_doubles(all.F, d * d);                                                       \
                write_double(all.J);                                                               \
                write_doubles(all.P, d * d);                                                       \
                write_doubles(all.b, d);                                                           \
                WRITE_##energy(name)                                                               \
                TRACTIONS_##name                                                                   \
                name##_at_point(&s, Xp, kept);                                                     \
                name##_b_staged(&s, &time, kept, 1, vector);                                       \
                write_doubles(vector, d);                                                          \
                name##_b_staged(&s, &time, point + p, n, vector);                                  \
                write_doubles(vector, d);                                                          \
                write_doubles(b + p * d, d);                                                       \
            }                                                                                      \
            printf("\n");                                                                          \
        }                                                                                          \
        free(X);                                                                                   \
        free(point);                                                                               \
        free(b);                                                                                   \
    }

SOLUTIONS
#undef SOLUTION

#define SOLUTION(name, domain, energy)                                                             \
    if (strcmp(given, #name) == 0) {                                                               \
        run_##name();                                                                              \
        continue;                                                                                  \
    }

int main(void)
{
    char given[80];
    while (scanf("%79s", given) == 1) {
        SOLUTIONS
        fprintf(stderr, "there is no solution %s\n", given);
        return 2;
    }
    return 0;
}
