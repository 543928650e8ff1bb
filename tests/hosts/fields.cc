// Evaluates a generated C++ header at the points of a file of doubles: the number of points, then for each X and t. Writes u, v, a, H, F,
// J, P, b, rho0_b, static_force, sigma and S of each point. Compiled with -DHEADER, -DSPACE.
#include HEADER

#include <cstdio>
#include <vector>

// A dual number as hosts have it: one derivative, no conversions.
struct Dual {
    double value;
    double slope;
    Dual &operator=(double x)
    {
        value = x;
        slope = 0.0;
        return *this;
    }
};
Dual operator-(Dual a) { return {-a.value, -a.slope}; }
Dual operator+(Dual a, Dual b) { return {a.value + b.value, a.slope + b.slope}; }
Dual operator+(Dual a, double b) { return {a.value + b, a.slope}; }
Dual operator+(double a, Dual b) { return b + a; }
Dual operator-(Dual a, Dual b) { return {a.value - b.value, a.slope - b.slope}; }
Dual operator-(Dual a, double b) { return {a.value - b, a.slope}; }
Dual operator-(double a, Dual b) { return {a - b.value, -b.slope}; }
Dual operator*(Dual a, Dual b) { return {a.value * b.value, a.slope * b.value + a.value * b.slope}; }
Dual operator*(Dual a, double b) { return {a.value * b, a.slope * b}; }
Dual operator*(double a, Dual b) { return b * a; }
Dual operator/(Dual a, Dual b) { return {a.value / b.value, (a.slope - a.value / b.value * b.slope) / b.value}; }
Dual operator/(Dual a, double b) { return {a.value / b, a.slope / b}; }
Dual operator/(double a, Dual b) { return {a / b.value, -a / b.value / b.value * b.slope}; }
bool operator<(Dual a, double b) { return a.value < b; }
bool operator<(double a, Dual b) { return a < b.value; }
bool operator<=(Dual a, double b) { return a.value <= b; }
bool operator<=(double a, Dual b) { return a <= b.value; }
bool operator==(Dual a, double b) { return a.value == b; }
bool operator==(Dual a, Dual b) { return a.value == b.value; }
Dual sin(Dual x) { return {std::sin(x.value), std::cos(x.value) * x.slope}; }
Dual cos(Dual x) { return {std::cos(x.value), -std::sin(x.value) * x.slope}; }
Dual sqrt(Dual x) { return {std::sqrt(x.value), 0.5 / std::sqrt(x.value) * x.slope}; }
Dual exp(Dual x) { return {std::exp(x.value), std::exp(x.value) * x.slope}; }
Dual log(Dual x) { return {std::log(x.value), x.slope / x.value}; }
Dual log1p(Dual x) { return {std::log1p(x.value), x.slope / (1.0 + x.value)}; }
Dual expm1(Dual x) { return {std::expm1(x.value), std::exp(x.value) * x.slope}; }
Dual atan2(Dual y, Dual x)
{
    const double square = x.value * x.value + y.value * y.value;
    return {std::atan2(y.value, x.value), (x.value * y.slope - y.value * x.slope) / square};
}
Dual pow(Dual x, double p) { return {std::pow(x.value, p), p * std::pow(x.value, p - 1.0) * x.slope}; }

static void write(double x) { std::fwrite(&x, sizeof x, 1, stdout); }

template <std::size_t N>
static void write(const std::array<double, N> &vector)
{
    for (double x : vector) {
        write(x);
    }
}

template <std::size_t N>
static void write(const std::array<std::array<double, N>, N> &matrix)
{
    for (const auto &row : matrix) {
        write(row);
    }
}

int main()
{
    constexpr int d = SPACE::Solution::dimension;
    SPACE::Solution s;
#ifdef TABLE
    s.read_table(TABLE);
#endif
    double n = 0;
    if (std::fread(&n, sizeof n, 1, stdin) != 1) {
        return 2;
    }
    double point[d + 1];
    while (n-- > 0 && std::fread(point, sizeof point, 1, stdin) == 1) {
        const double t = point[d];
        write(s.u(point, t));
        write(s.v(point, t));
        write(s.a(point, t));
        write(s.H(point, t));
        write(s.F(point, t));
        write(s.J(point, t));
        write(s.P(point, t));
        write(s.b(point, t));
        write(s.rho0_b(point, t));
        write(s.static_force(point, t));
        write(s.sigma(point, t));
        write(s.S(point, t));
#ifdef TABLE
        // Series have the same fields.
        const auto series = s.series(point);
        const auto b = s.b(point, t), of_series = series.b(t);
        const auto internal = s.internal(point, t);
        for (int i = 0; i < d; ++i) {
            if (!(std::abs(b[i] - of_series[i]) <= 1e-12 * (1e4 + std::abs(b[i])))) {
                std::fprintf(stderr, "b_%d of a series is %.17g, not %.17g\n", i, of_series[i], b[i]);
                return 1;
            }
        }
        for (std::size_t k = 0; k < internal.size(); ++k) {
            if (!(std::abs(series.internal(t)[k] - internal[k]) <= 1e-9 + 1e-12 * std::abs(internal[k]))) {
                return 1;
            }
        }
        write(internal);
#endif
#ifdef DUALS
        // The derivatives of u are H.
        const auto H = s.H(point, t);
        for (int j = 0; j < d; ++j) {
            std::array<Dual, d> X;
            for (int i = 0; i < d; ++i) {
                X[i] = Dual{point[i], i == j ? 1.0 : 0.0};
            }
            const auto u = s.u(X, t);
            s.static_force(X, t);
            s.sigma(X, t);
            s.S(X, t);
            for (int i = 0; i < d; ++i) {
                if (!(std::abs(u[i].slope - H[i][j]) <= 1e-12 * (1.0 + std::abs(H[i][j])))) {
                    std::fprintf(stderr, "du_%d/dX_%d by dual numbers is %.17g, H is %.17g\n", i, j, u[i].slope, H[i][j]);
                    return 1;
                }
            }
        }
#endif
    }
#ifdef TABLE
    point[0] = s.b(point, 1.001 * s.end_of_table())[0];
    if (point[0] == point[0]) {
        std::fprintf(stderr, "a value after the end of the table\n");
        return 1;
    }
    try {
        s.read_table(HEADER);
        return 1;
    } catch (const std::runtime_error &) {
    }
#endif
    return 0;
}
