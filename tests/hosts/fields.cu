// Evaluates a generated C header on a graphics processor at the points of a file of doubles: the number of points, then for each X and t.
// Writes u, v, a, H, F, J, P and b of each point. Compiled with -DHEADER, -DNAME. The body force in stages has to agree, but for rounding.
#include HEADER

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <vector>

#define JOINED(a, b) a##b
#define JOIN(a, b) JOINED(a, b)
#define OF(member) JOIN(NAME, member)

constexpr int d = OF(_dimension);
constexpr int kept = OF(_point_count);

__global__ void evaluate(OF(_solution) s, int n, const double *points, OF(_field_values) * fields, double *of_points, double *forces)
{
    const int p = blockIdx.x * blockDim.x + threadIdx.x;
    if (p >= n) {
        return;
    }
    const double *X = points + p * (d + 1), t = X[d];
    OF(_fields)(&s, X, t, fields + p);
    double values[kept + 1];
    OF(_at_point)(&s, X, values);
    for (int m = 0; m < kept; ++m) {
        of_points[m * n + p] = values[m];
    }
    const OF(_time_values) time = OF(_at_time)(&s, t);
    OF(_b_staged)(&s, &time, of_points + p, n, forces + p * d);
}

static void check(cudaError_t status)
{
    if (status != cudaSuccess) {
        std::fprintf(stderr, "%s\n", cudaGetErrorString(status));
        std::exit(2);
    }
}

template <typename T>
struct OnDevice {
    T *at = nullptr;
    explicit OnDevice(std::size_t count) { check(cudaMalloc(&at, (count + 1) * sizeof(T))); }
    ~OnDevice() { cudaFree(at); }
};

int main()
{
    double count = 0;
    if (std::fread(&count, sizeof count, 1, stdin) != 1) {
        return 2;
    }
    const int n = static_cast<int>(count);
    std::vector<double> points(n * (d + 1));
    if (std::fread(points.data(), sizeof(double), points.size(), stdin) != points.size()) {
        return 2;
    }
    OF(_parameters) parameters = OF(_defaults)();
    OF(_solution) s;
    if (const char *message = OF(_prepare)(&s, &parameters)) {
        std::fprintf(stderr, "%s\n", message);
        return 2;
    }
    OnDevice<double> on_device(points.size()), of_points(n * kept), forces(n * d);
    OnDevice<OF(_field_values)> values(n);
    check(cudaMemcpy(on_device.at, points.data(), points.size() * sizeof(double), cudaMemcpyHostToDevice));
    evaluate<<<(n + 63) / 64, 64>>>(s, n, on_device.at, values.at, of_points.at, forces.at);
    check(cudaGetLastError());
    std::vector<OF(_field_values)> fields(n);
    std::vector<double> staged(n * d);
    check(cudaMemcpy(fields.data(), values.at, n * sizeof fields[0], cudaMemcpyDeviceToHost));
    check(cudaMemcpy(staged.data(), forces.at, n * d * sizeof(double), cudaMemcpyDeviceToHost));
    double largest = 0.0;
    for (const OF(_field_values) &at : fields) {
        for (double b : at.b) {
            largest = std::fmax(largest, std::abs(b));
        }
    }
    for (int p = 0; p < n; ++p) {
        const OF(_field_values) &at = fields[p];
        std::fwrite(at.u, sizeof at.u, 1, stdout);
        std::fwrite(at.v, sizeof at.v, 1, stdout);
        std::fwrite(at.a, sizeof at.a, 1, stdout);
        std::fwrite(at.H, sizeof at.H, 1, stdout);
        std::fwrite(at.F, sizeof at.F, 1, stdout);
        std::fwrite(&at.J, sizeof at.J, 1, stdout);
        std::fwrite(at.P, sizeof at.P, 1, stdout);
        std::fwrite(at.b, sizeof at.b, 1, stdout);
        for (int i = 0; i < d; ++i) {
            if (!(std::abs(staged[p * d + i] - at.b[i]) <= 1e-12 * largest)) {
                std::fprintf(stderr, "b_%d is %.17g in stages and %.17g in one call\n", i, staged[p * d + i], at.b[i]);
                return 1;
            }
        }
    }
    return 0;
}
