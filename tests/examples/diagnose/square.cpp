// Explicit bilinear elements on the unit square, and mistakes that can be planted in them: square CELLS OUT MISTAKE.
#include "skew_2d.hpp"
#include <array>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

using Vector = std::array<double, 2>;

int main(int count, char **argument) {
    const int n = std::stoi(argument[1]), line = n + 1;
    const std::string out = argument[2], mistake = count > 3 ? argument[3] : "";
    const auto is = [&](const char *one) { return mistake == one; };
    const mms::skew_2d::Solution exact{mms::skew_2d::Parameters{}};
    const double h = 1.0 / n, rho = exact.density();
    double lambda = exact.lambda(), mu = exact.mu();
    const double fast = std::sqrt((lambda + 2 * mu) / rho), end = 0.4 * exact.period();
    const int steps = std::ceil(end * fast / (0.3 * h));
    const double dt = end / steps;
    if (is("moduli-exchanged")) std::swap(lambda, mu);
    if (is("plane-stress")) lambda = 2 * lambda * mu / (lambda + 2 * mu);
    if (is("bulk-modulus-for-lambda")) lambda += 2 * mu / 3;

    const int nodes = line * line;
    std::vector<Vector> X(nodes), u(nodes), v(nodes), force(nodes);
    std::vector<double> mass(nodes, 0.0);
    const auto held = [&](int node) {
        const int i = node % line, j = node / line;
        return i == 0 || i == n || j == 0 || j == n;
    };
    for (int node = 0; node < nodes; ++node) {
        X[node] = {node % line * h, node / line * h};
        u[node] = exact.u(X[node], 0.0);
        v[node] = exact.v(X[node], is("initial-velocity-half-step-ahead") ? 0.0 : -dt / 2);
        if (is("initial-velocity-sign")) v[node] = {-v[node][0], -v[node][1]};
    }
    const auto corner = [&](int element, int a) {
        const int right[] = {0, 1, 1, 0}, up[] = {0, 0, 1, 1};
        return (element / n + up[a]) * line + element % n + right[a];
    };
    for (int element = 0; element < n * n; ++element)
        for (int a = 0; a < 4; ++a)
            mass[corner(element, a)] += rho * h * h / (is("internal-force-fourfold") ? 16 : 4);
    const double gauss = 1 / std::sqrt(3.0);
    const double sign[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    for (int step = 0; step < steps; ++step) {
        const double t = step * dt;
        for (auto &one : force) one = {0, 0};
        for (int element = 0; element < n * n; ++element)
            for (int q = 0; q < 4; ++q) {
                const double xi = gauss * sign[q][0], eta = gauss * sign[q][1];
                double gradient[4][2], F[2][2] = {{1, 0}, {0, 1}}, P[2][2], f[2][2];
                for (int a = 0; a < 4; ++a) {
                    gradient[a][0] = sign[a][0] * (1 + sign[a][1] * eta) / (2 * h);
                    gradient[a][1] = sign[a][1] * (1 + sign[a][0] * xi) / (2 * h);
                    for (int i = 0; i < 2; ++i)
                        for (int J = 0; J < 2; ++J) F[i][J] += u[corner(element, a)][i] * gradient[a][J];
                }
                const double det = F[0][0] * F[1][1] - F[0][1] * F[1][0];
                f[0][0] = F[1][1] / det, f[0][1] = -F[1][0] / det, f[1][0] = -F[0][1] / det, f[1][1] = F[0][0] / det;
                if (is("law-inverse-not-transposed")) std::swap(f[0][1], f[1][0]);
                const double volume = is("law-neo-hookean-volume-change") ? det - 1 : std::log(det);
                for (int i = 0; i < 2; ++i)
                    for (int J = 0; J < 2; ++J) P[i][J] = mu * (F[i][J] - f[i][J]) + lambda * volume * f[i][J];
                if (is("stress-transposed")) std::swap(P[0][1], P[1][0]);
                if (is("stress-shear-halved")) P[0][1] /= 2, P[1][0] /= 2;
                if (is("stress-kirchhoff") || is("stress-cauchy")) {
                    double tau[2][2];
                    for (int i = 0; i < 2; ++i)
                        for (int j = 0; j < 2; ++j) tau[i][j] = (P[i][0] * F[j][0] + P[i][1] * F[j][1]) / (is("stress-cauchy") ? det : 1);
                    for (int i = 0; i < 2; ++i)
                        for (int j = 0; j < 2; ++j) P[i][j] = tau[i][j];
                }
                for (int a = 0; a < 4; ++a)
                    for (int i = 0; i < 2; ++i)
                        force[corner(element, a)][i] -= (P[i][0] * gradient[a][0] + P[i][1] * gradient[a][1]) * h * h / 4;
            }
        for (int node = 0; node < nodes; ++node) {
            double at = t;
            if (is("force-step-ahead")) at += dt;
            if (is("force-half-step-ahead")) at += dt / 2;
            if (is("force-frozen")) at = 0;
            Vector place = X[node];
            if (is("force-at-current-position")) place = {place[0] + u[node][0], place[1] + u[node][1]};
            if (is("force-coordinates-exchanged")) std::swap(place[0], place[1]);
            Vector b = exact.b(place, at);
            if (is("force-components-exchanged")) std::swap(b[0], b[1]);
            if (is("force-Y-sign")) b[1] = -b[1];
            if (is("force-per-mass")) b = {b[0] / rho, b[1] / rho};
            for (int i = 0; i < 2; ++i) v[node][i] += dt * (force[node][i] / mass[node] + b[i]);
            for (int i = 0; i < 2; ++i) u[node][i] += dt * v[node][i];
            const double to = is("boundary-step-behind") ? t : is("boundary-step-ahead") ? t + 2 * dt : is("boundary-unused") ? 0.0 : t + dt;
            if (held(node)) u[node] = exact.u(X[node], to);
        }
    }
    FILE *file = std::fopen((out + "/square.csv").c_str(), "w");
    std::fprintf(file, "t,X,Y,ux,uy\n");
    for (int node = 0; node < nodes; ++node)
        std::fprintf(file, "%.17g,%.17g,%.17g,%.17g,%.17g\n", end, X[node][0], X[node][1], u[node][0], u[node][1]);
    std::fclose(file);
    file = std::fopen((out + "/dt").c_str(), "w");
    std::fprintf(file, "%.17g\n", dt);
    return std::fclose(file);
}
