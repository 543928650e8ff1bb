// The names of OpenFOAM that the fragments call, around their code: cells and faces at the points that come in, of volume one half. Writes
// the source of each and the motion of each.
#include "HEADER"

#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <vector>

using scalar = double;
using label = int;

struct vector {
    double c[3];
    vector() : c{0.0, 0.0, 0.0} {}
    vector(double x, double y, double z) : c{x, y, z} {}
    double x() const { return c[0]; }
    double y() const { return c[1]; }
    double z() const { return c[2]; }
    double &operator[](int i) { return c[i]; }
    static const vector zero;
};
const vector vector::zero = vector();

using vectorField = std::vector<vector>;
using scalarField = std::vector<double>;

#define forAll(list, i) for (label i = 0; i < static_cast<label>((list).size()); ++i)
#define FatalErrorInFunction std::cerr
static const int FatalError = 1;
#define exit(code) (std::exit(code), "")

struct Time {
    double now;
    const Time &time() const { return *this; }
    double value() const { return now; }
};
struct Mesh : Time {
    vectorField centres;
    scalarField volumes;
    const vectorField &C() const { return centres; }
    const vectorField &Cf() const { return centres; }
    const scalarField &V() const { return volumes; }
};
struct Equation {
    vectorField sum;
    vectorField &source() { return sum; }
};

static void addSup(const Mesh &mesh_, Equation &eqn)
{
ADD_SUP
}

struct Patch {
    Mesh mesh;
    vectorField moved;
    const Mesh &patch() const { return mesh; }
    const Time &db() const { return mesh; }
    void operator==(const vectorField &motion) { moved = motion; }
    void update()
    {
MOTION
    }
};

int main()
{
    double point[4];
    while (std::fread(point, sizeof point, 1, stdin) == 1) {
        Mesh mesh;
        mesh.now = point[3];
        mesh.centres = {vector(point[0], point[1], point[2])};
        mesh.volumes = {0.5};
        Equation equation;
        equation.sum = vectorField(1);
        addSup(mesh, equation);
        Patch patch{mesh, {}};
        patch.update();
        std::fwrite(equation.sum[0].c, sizeof equation.sum[0].c, 1, stdout);
        std::fwrite(patch.moved[0].c, sizeof patch.moved[0].c, 1, stdout);
    }
    return 0;
}
