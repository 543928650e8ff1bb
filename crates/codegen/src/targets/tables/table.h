#ifndef MMSMITH_TABLE
#define MMSMITH_TABLE 1

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { mmsmith_most_fields = 256, mmsmith_most_polynomials = 64, mmsmith_most_knots = 64 };

/* Fields of position and time: Chebyshev series in coordinates of the body, and in pieces of the time. Or, where points is positive, series
   in time of these points alone. */
typedef struct mmsmith_table {
    int dimension, fields, quantities, axes, pieces, in_time;
    /* 'b', 'a' or 't': a box, a body between two radii, or a tube, a sector or a cylinder about the third axis. */
    char chart;
    /* 'c', 'p' or 's': components are Cartesian, polar or spherical until they are turned. */
    char frame;
    /* 's', 'v', 'm', 't': scalar, vector, matrix, symmetric tensor; then the number of its first entry. */
    char shape[mmsmith_most_fields];
    int first[mmsmith_most_fields + 1];
    int axis[3], count[3];
    double low[3], high[3], end, knots[mmsmith_most_knots];
    long nodes, points;
    /* For each point its position, its pieces, and where its knots and coefficients begin. */
    double *places;
    int *piece_counts;
    long *begins;
    double *coefficients;
} mmsmith_table;

MMSMITH_FN void mmsmith_polynomials(double x, int n, double *values)
{
    int k;
    double last = 1.0, next = x;
    for (k = 0; k < n; ++k) {
        const double after = 2.0 * x * next - last;
        values[k] = last;
        last = next;
        next = after;
    }
}

/* The piece of a time and the polynomials there, of series with these knots; not numbers before the start and after the end. */
MMSMITH_FN void mmsmith_moment(const double *knots, int pieces, int in_time, double t, double *values)
{
    const double end = pieces > 0 ? knots[pieces] : 0.0;
    const int is_known = t >= -1e-12 * end && t <= end * (1.0 + 1e-12);
    int k, piece = 0;
    while (piece + 1 < pieces && knots[piece + 1] <= t) {
        ++piece;
    }
    values[0] = piece;
    if (is_known && pieces > 0) {
        mmsmith_polynomials((2.0 * t - knots[piece] - knots[piece + 1]) / (knots[piece + 1] - knots[piece]), in_time, values + 1);
    } else {
        for (k = 0; k < in_time; ++k) {
            values[1 + k] = (double)NAN;
        }
    }
}

/* The polynomials along each axis at a position; not numbers far from the body. */
MMSMITH_FN void mmsmith_along(const mmsmith_table *table, const double *X, double values[3][mmsmith_most_polynomials])
{
    const double around = 6.283185307179586;
    double q[3] = {0.0, 0.0, 0.0};
    int k;
    for (k = 0; k < table->dimension; ++k) {
        q[k] = X[k];
    }
    if (table->chart == 't') {
        q[0] = hypot(X[0], X[1]);
        q[1] = atan2(X[1], X[0]);
    }
    if (table->chart == 'a' && table->dimension > 1) {
        const double from_axis = hypot(X[0], X[1]);
        const double angle = atan2(X[1], X[0]);
        q[0] = table->dimension == 2 ? from_axis : hypot(from_axis, X[2]);
        q[1] = table->dimension == 2 ? angle : atan2(from_axis, X[2]);
        q[2] = angle;
        q[table->dimension - 1] += angle < 0.0 ? around : 0.0;
    }
    for (k = 0; k < 3; ++k) {
        values[k][0] = 1.0;
        if (k < table->axes) {
            const double low = table->low[k], high = table->high[k];
            double x;
            if (table->chart == 't' && table->axis[k] == 1) {
                q[1] += around * floor((0.5 * (low + high) - q[1]) / around + 0.5);
            }
            x = (2.0 * q[table->axis[k]] - low - high) / (high - low);
            mmsmith_polynomials(fabs(x) <= 1.1 ? x : (double)NAN, table->count[k], values[k]);
        }
    }
}

/* The sum over the nodes of one column of coefficients. */
MMSMITH_FN double mmsmith_over_nodes(const mmsmith_table *table, double along[3][mmsmith_most_polynomials], const double *column)
{
    double sum = 0.0;
    int i, j, k;
    for (k = 0; k < table->count[2]; ++k) {
        double layer = 0.0;
        for (j = 0; j < table->count[1]; ++j) {
            double line = 0.0;
            for (i = 0; i < table->count[0]; ++i) {
                line += *column++ * along[0][i];
            }
            layer += line * along[1][j];
        }
        sum += layer * along[2][k];
    }
    return sum;
}

/* Turns the entries of a field, which are `stride` apart, to Cartesian components. */
MMSMITH_FN void mmsmith_turn(const mmsmith_table *table, const double *X, char shape, double *values, size_t stride)
{
    static const int full[3][3] = {{0, 3, 4}, {3, 1, 5}, {4, 5, 2}};
    double Q[3][3] = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};
    double own[3][3], turned[3][3];
    const int d = shape == 't' ? 3 : table->dimension;
    const double s = hypot(X[0], table->dimension > 1 ? X[1] : 0.0);
    int i, j, k, l;
    if (table->frame == 'c' || shape == 's') {
        return;
    }
    if (table->frame == 'p') {
        Q[0][0] = Q[1][1] = X[0] / s;
        Q[1][0] = X[1] / s;
        Q[0][1] = -Q[1][0];
    } else {
        const double r = hypot(s, X[2]), cosine = X[0] / s, sine = X[1] / s;
        Q[0][0] = X[0] / r, Q[0][1] = X[2] / r * cosine, Q[0][2] = -sine;
        Q[1][0] = X[1] / r, Q[1][1] = X[2] / r * sine, Q[1][2] = cosine;
        Q[2][0] = X[2] / r, Q[2][1] = -s / r, Q[2][2] = 0.0;
    }
    for (i = 0; i < d; ++i) {
        for (j = 0; j < (shape == 'v' ? 1 : d); ++j) {
            own[i][j] = values[stride * (size_t)(shape == 'v' ? i : shape == 'm' ? i * d + j : full[i][j])];
            turned[i][j] = 0.0;
        }
    }
    for (i = 0; i < d; ++i) {
        for (j = 0; j < (shape == 'v' ? 1 : d); ++j) {
            for (k = 0; k < d; ++k) {
                for (l = 0; l < (shape == 'v' ? 1 : d); ++l) {
                    turned[i][j] += Q[i][k] * own[k][l] * (shape == 'v' ? 1.0 : Q[j][l]);
                }
            }
        }
    }
    for (i = 0; i < d; ++i) {
        for (j = 0; j < (shape == 'v' ? 1 : d); ++j) {
            values[stride * (size_t)(shape == 'v' ? i : shape == 'm' ? i * d + j : full[i][j])] = turned[i][j];
        }
    }
}

/* The number of a point of the table, by its position; -1 where the table has series over the body, or no such point. */
MMSMITH_FN long mmsmith_point_of(const mmsmith_table *table, const double *X)
{
    const int d = table->dimension;
    double farthest = 0.0;
    long n;
    int k;
    for (n = 0; n < table->points * d; ++n) {
        farthest = fmax(farthest, fabs(table->places[n]));
    }
    for (n = 0; n < table->points; ++n) {
        const double *place = table->places + n * d;
        for (k = 0; k < d && fabs(X[k] - place[k]) <= 1e-9 * fabs(place[k]) + 1e-12 * farthest; ++k) {
        }
        if (k == d) {
            return n;
        }
    }
    return -1;
}

/* A field at the point of a number and a time. */
MMSMITH_FN void mmsmith_field_of_point(const mmsmith_table *table, long n, double t, int field, int count, double *values)
{
    double moment[1 + mmsmith_most_polynomials];
    int entry, k;
    for (entry = 0; entry < count; ++entry) {
        double sum = (double)NAN;
        if (n >= 0 && n < table->points) {
            const double *knots = table->coefficients + table->begins[n];
            const int pieces = table->piece_counts[n];
            const double *own = knots + pieces + 1;
            mmsmith_moment(knots, pieces, table->in_time, t, moment);
            own += (size_t)((table->first[field] + entry) * pieces + (int)moment[0]) * (size_t)table->in_time;
            for (sum = 0.0, k = 0; k < table->in_time; ++k) {
                sum += own[k] * moment[1 + k];
            }
        }
        values[entry] = sum;
    }
}

/* A field at a position and a time, in Cartesian components. */
MMSMITH_FN void mmsmith_field(const mmsmith_table *table, const double *X, double t, int field, int count, double *values)
{
    double moment[1 + mmsmith_most_polynomials], along[3][mmsmith_most_polynomials];
    int entry, k;
    if (!table->coefficients || table->points > 0) {
        mmsmith_field_of_point(table, mmsmith_point_of(table, X), t, field, count, values);
        return;
    }
    mmsmith_moment(table->knots, table->pieces, table->in_time, t, moment);
    mmsmith_along(table, X, along);
    for (entry = 0; entry < count; ++entry) {
        const long column = ((long)(table->first[field] + entry) * table->pieces + (long)moment[0]) * table->in_time;
        double sum = 0.0;
        for (k = 0; k < table->in_time; ++k) {
            sum += moment[1 + k] * mmsmith_over_nodes(table, along, table->coefficients + (column + k) * table->nodes);
        }
        values[entry] = sum;
    }
    mmsmith_turn(table, X, table->shape[field], values, 1);
}

/* A field of `count` entries at a position as series in time: for each entry and each of `steps` the coefficient of its polynomial. */
MMSMITH_FN void mmsmith_series(const mmsmith_table *table, const double *X, int field, int count, int steps, double *series)
{
    double along[3][mmsmith_most_polynomials];
    int k;
    if (!table->coefficients) {
        for (k = 0; k < count * steps; ++k) {
            series[k] = (double)NAN;
        }
        return;
    }
    mmsmith_along(table, X, along);
    for (k = 0; k < count * steps; ++k) {
        const long column = (long)table->first[field] * steps + k;
        series[k] = mmsmith_over_nodes(table, along, table->coefficients + column * table->nodes);
    }
    for (k = 0; k < steps; ++k) {
        mmsmith_turn(table, X, table->shape[field], series + k, (size_t)steps);
    }
}

/* Entry k of a field whose series has its coefficients `stride` apart. */
MMSMITH_FN double mmsmith_of_series(int pieces, int in_time, const double *moment, const double *series, size_t stride, int entry)
{
    const double *own = series + stride * (size_t)((entry * pieces + (int)moment[0]) * in_time);
    double sum = 0.0;
    int k;
    for (k = 0; k < in_time; ++k) {
        sum += own[stride * (size_t)k] * moment[1 + k];
    }
    return sum;
}

static inline void mmsmith_table_free(mmsmith_table *table)
{
    free(table->coefficients);
    free(table->places);
    free(table->piece_counts);
    free(table->begins);
    memset(table, 0, sizeof *table);
}

static inline int mmsmith_table_numbers(FILE *file, long count, double *values)
{
    long k;
    for (k = 0; k < count; ++k) {
        if (fscanf(file, "%lf", values + k) != 1) {
            return 0;
        }
    }
    return 1;
}

/* The series of points: the numbers of each one are read behind those of the one before. */
static inline int mmsmith_table_points(FILE *file, mmsmith_table *table)
{
    long n, used = 0, room = 0;
    const int d = table->dimension;
    table->places = (double *)calloc((size_t)(table->points * d), sizeof(double));
    table->piece_counts = (int *)calloc((size_t)table->points, sizeof(int));
    table->begins = (long *)calloc((size_t)table->points, sizeof(long));
    for (n = 0; n < table->points; ++n) {
        long own;
        if (!table->places || !table->piece_counts || !table->begins || !mmsmith_table_numbers(file, d, table->places + n * d)
            || fscanf(file, "%d %d", table->piece_counts + n, &table->in_time) != 2 || table->piece_counts[n] < 1
            || table->in_time < 1 || table->in_time > mmsmith_most_polynomials) {
            return 0;
        }
        own = table->piece_counts[n] + 1 + (long)table->quantities * table->piece_counts[n] * table->in_time;
        if (used + own > room) {
            double *grown;
            room = 2 * (used + own);
            grown = (double *)realloc(table->coefficients, (size_t)room * sizeof(double));
            if (!grown) {
                return 0;
            }
            table->coefficients = grown;
        }
        table->begins[n] = used;
        if (!mmsmith_table_numbers(file, own, table->coefficients + used)) {
            return 0;
        }
        used += own;
    }
    return table->points > 0;
}

static inline int mmsmith_table_content(FILE *file, mmsmith_table *table)
{
    char word[2][72];
    int k, count = 0;
    long numbers = 0;
    double value;
    if (fscanf(file, " solution %71s parameters %d", word[0], &count) != 2) {
        return 0;
    }
    for (k = 0; k < count; ++k) {
        if (fscanf(file, " %71s %lf", word[0], &value) != 2) {
            return 0;
        }
    }
    if (fscanf(file, " end %lf error %lf dimension %d fields %d", &table->end, &value, &table->dimension, &table->fields) != 4
        || table->dimension < 1 || table->dimension > 3 || table->fields < 2 || table->fields > mmsmith_most_fields) {
        return 0;
    }
    for (k = 0; k < table->fields; ++k) {
        if (fscanf(file, " %71s %71s", word[0], word[1]) != 2) {
            return 0;
        }
        table->shape[k] = word[1][1] == 'y' ? 't' : word[1][0];
        count = table->shape[k] == 't' ? 6 : table->shape[k] == 's' ? 1 : table->dimension;
        count *= table->shape[k] == 'm' ? table->dimension : 1;
        table->first[k + 1] = table->first[k] + count;
    }
    table->quantities = table->first[table->fields];
    if (fscanf(file, " chart %71s frame %71s", word[0], word[1]) != 2) {
        return 0;
    }
    table->chart = word[0][0];
    table->frame = word[1][0];
    if (word[0][0] == 'p') {
        return fscanf(file, " points %ld", &table->points) == 1 && table->points > 0 && mmsmith_table_points(file, table);
    }
    if (fscanf(file, " axes %d", &table->axes) != 1 || table->axes < 1 || table->axes > 3) {
        return 0;
    }
    table->nodes = 1;
    for (k = 0; k < 3; ++k) {
        table->count[k] = 1;
        if (k < table->axes && (fscanf(file, "%d %lf %lf %d", table->axis + k, table->low + k, table->high + k, table->count + k) != 4
            || table->axis[k] < 0 || table->axis[k] > 2 || table->count[k] < 1 || table->count[k] > mmsmith_most_polynomials)) {
            return 0;
        }
        table->nodes *= table->count[k];
    }
    if (fscanf(file, " pieces %d %d", &table->pieces, &table->in_time) != 2 || table->pieces < 1 || table->pieces >= mmsmith_most_knots
        || table->in_time < 1 || table->in_time > mmsmith_most_polynomials
        || !mmsmith_table_numbers(file, table->pieces + 1, table->knots) || fscanf(file, " coefficients %ld", &numbers) != 1
        || numbers != (long)table->quantities * table->pieces * table->in_time * table->nodes) {
        return 0;
    }
    table->coefficients = (double *)malloc((size_t)numbers * sizeof(double));
    return table->coefficients && mmsmith_table_numbers(file, numbers, table->coefficients);
}

/* Reads a table. A null pointer, or the first of the messages where there is no such file, the second where it is another table, and the
   third where it is not whole; there is no table then. */
static inline const char *mmsmith_table_read(mmsmith_table *table, const char *path, const char *digest, const char *const messages[3])
{
    char found[72] = "";
    int version = 0, is_whole;
    FILE *file = fopen(path, "r");
    memset(table, 0, sizeof *table);
    if (!file) {
        return messages[0];
    }
    if (fscanf(file, "mmsmith-table %d digest %71s", &version, found) != 2 || version != 1 || strcmp(found, digest) != 0) {
        fclose(file);
        return messages[version == 1 ? 1 : 2];
    }
    is_whole = mmsmith_table_content(file, table);
    fclose(file);
    if (!is_whole) {
        mmsmith_table_free(table);
        return messages[2];
    }
    return 0;
}

#endif

