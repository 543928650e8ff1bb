/* As fields.cc, for a C header: u, v, a, H, F, J, P and b of each point, and the internal variables where the header has a table. The body
   force in stages, and the fields of series, have to agree. Compiled with -DHEADER, -DNAME, and -DTABLE with its path. */
#include HEADER

#include <stdio.h>

#define JOINED(a, b) a##b
#define JOIN(a, b) JOINED(a, b)
#define OF(member) JOIN(NAME, member)

enum { d = OF(_dimension), kept = OF(_point_count) + 1 };

static void put(const double *values, int count) { fwrite(values, sizeof *values, (size_t)count, stdout); }

static int differ(const char *what, const double *one, const double *other, int count, double scale)
{
    int i;
    for (i = 0; i < count; ++i) {
        if (!(fabs(one[i] - other[i]) <= 1e-12 * scale)) {
            fprintf(stderr, "%s %d is %.17g in one way and %.17g in another\n", what, i, one[i], other[i]);
            return 1;
        }
    }
    return 0;
}

int main(void)
{
    static double point[kept], X[d + 1], staged[d];
    const OF(_parameters) p = OF(_defaults)();
    static OF(_solution) s;
    double n = 0, largest = 0;
    const char *message = OF(_prepare)(&s, &p);
#ifdef TABLE
    message = message ? message : OF(_read_table)(&s, TABLE);
#endif
    if (message) {
        fprintf(stderr, "%s\n", message);
        return 2;
    }
    if (fread(&n, sizeof n, 1, stdin) != 1) {
        return 2;
    }
    while (n-- > 0 && fread(X, sizeof X, 1, stdin) == 1) {
        const double t = X[d];
        OF(_field_values) at;
        OF(_time_values) time = OF(_at_time)(&s, t);
        OF(_fields)(&s, X, t, &at);
        put(at.u, d), put(at.v, d), put(at.a, d), put(at.H, d * d), put(at.F, d * d), put(&at.J, 1), put(at.P, d * d), put(at.b, d);
        largest = fmax(largest, fabs(at.b[0]));
        OF(_at_point)(&s, X, point);
        OF(_b_staged)(&s, &time, point, 1, staged);
        if (differ("b", staged, at.b, d, fmax(1.0, largest))) {
            return 1;
        }
#ifdef INTERNAL
        {
            double all[INTERNAL];
            OF(_internal)(&s, X, t, all);
            put(all, INTERNAL);
        }
#endif
#ifdef SERIES
        {
            static double series[OF(_series_length)];
            double own[d * d + 1];
            OF(_series)(&s, X, series);
            OF(_b_of_series)(&time, series, own);
            if (differ("b of a series", own, at.b, d, fmax(1.0, largest))) {
                return 1;
            }
            OF(_P_of_series)(&time, series, own);
            if (differ("P of a series", own, at.P, d * d, fmax(1.0, fabs(at.P[0]) + fabs(at.P[d * d - 1])))) {
                return 1;
            }
        }
#endif
    }
#ifdef TABLE
    {
        /* No value after the end, and other tables are refused. */
        double b[d], end = s.table.end;
        OF(_parameters) other = p;
        OF(_solution) another;
        OF(_b)(&s, X, 1.001 * end, b);
        other.OTHER *= 1.5;
        if (b[0] == b[0] || !OF(_prepare)(&another, &other) || !OF(_read_table)(&s, HEADER)) {
            fprintf(stderr, "a value after the end, or a table that is not this one\n");
            return 1;
        }
    }
    OF(_free_table)(&s);
#endif
    return 0;
}
