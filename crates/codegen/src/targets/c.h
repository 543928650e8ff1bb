/*
@head@ */
#ifndef @GUARD@
#define @GUARD@ 1

#include <math.h>
#include <stddef.h>

#ifndef MMSMITH_FN
#if defined(__CUDACC__) || defined(__HIPCC__)
#define MMSMITH_FN static inline __host__ __device__
#else
#define MMSMITH_FN static inline
#endif
#endif

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif

#ifndef MMSMITH_NEAREST
#define MMSMITH_NEAREST 1

/* The nearest whole number, of two the even one. From 2^52 on doubles are whole numbers, so that adding 3 2^51 rounds. */
MMSMITH_FN double mmsmith_nearest(double x)
{
    return fabs(x) < 2251799813685248.0 ? (x + 6755399441055744.0) - 6755399441055744.0 : round(x);
}

#endif

@routines@@table_reader@/* Space dimensions, and the numbers of parameters and of values that the stages of b keep. */
enum {
    @NAME@_dimension = @d@,
    @NAME@_parameter_count = @parameter_count@,
    @NAME@_time_count = @time_count@,
    @NAME@_point_count = @point_count@
};

typedef struct @NAME@_parameters {
@parameters@} @NAME@_parameters;

/* The parameters, and the values that depend on them only. */
typedef struct @NAME@_solution {
    @NAME@_parameters par;
    double fixed[@fixed_length@];
@table_member@} @NAME@_solution;

/* What the body force needs of the time alone. */
typedef struct @NAME@_time_values {
    double values[@time_length@];
} @NAME@_time_values;

typedef struct @NAME@_field_values {
@field_values@} @NAME@_field_values;

MMSMITH_FN @NAME@_parameters @NAME@_defaults(void)
{
    @NAME@_parameters p;
@defaults@    return p;
}

/* Checks the parameters and computes what depends on them only. Returns a null pointer, or a message that says what is
   not admissible; *s is then as it was. */
MMSMITH_FN const char *@NAME@_prepare(@NAME@_solution *s, const @NAME@_parameters *p)
{
@prepare@    return 0;
}

@read_table@@fields@/* all fields */
MMSMITH_FN void @NAME@_fields(const @NAME@_solution *s, const double X[@d@], double t, @NAME@_field_values *out)
{
@all_fields@}

@series@/* What the body force needs of the time alone. */
MMSMITH_FN @NAME@_time_values @NAME@_at_time(const @NAME@_solution *s, double t)
{
    @NAME@_time_values time;
@at_time@    return time;
}

/* What the body force needs of the position alone. */
MMSMITH_FN void @NAME@_at_point(const @NAME@_solution *s, const double X[@d@], double point[@point_length@])
{
@at_point@}

/* The body force from the values of one time and of one point. Value m of the point is point[m*stride]: stride 1 after
   at_point; for point p of point_array pass point + p and stride n. */
MMSMITH_FN void @NAME@_b_staged(const @NAME@_solution *s, const @NAME@_time_values *time,
    const double *__restrict point, size_t stride, double *__restrict b)
{
@b_staged@}

/* What the body force needs of n positions alone: X[p*dimension + i] is component i of point p, and value m of
   point p goes to point[m*n + p]. The array `point` has n*point_count entries. */
MMSMITH_FN void @NAME@_point_array(const @NAME@_solution *s, size_t n, const double *__restrict X,
    double *__restrict point)
{
    size_t p, m;
    for (p = 0; p < n; ++p) {
        double values[@point_length@];
        @NAME@_at_point(s, X + p * @d@, values);
        for (m = 0; m != @NAME@_point_count; ++m) {
            point[m * n + p] = values[m];
        }
    }
}

/* The body force at time t of the points first, ..., first + count - 1 out of the n of point_array; component i of
   point p goes to b[p*dimension + i]. */
MMSMITH_FN void @NAME@_b_array(const @NAME@_solution *s, double t, size_t n,
    const double *__restrict point, size_t first, size_t count, double *__restrict b)
{
    const @NAME@_time_values time = @NAME@_at_time(s, t);
    const size_t end = first + count;
    size_t p;
    for (p = first; p < end; ++p) {
        @NAME@_b_staged(s, &time, point + p, n, b + p * @d@);
    }
}

@constants@#if defined(__clang__)
#pragma STDC FP_CONTRACT DEFAULT
#endif

#endif /* @GUARD@ */
