// Evaluates expressions, a line each, as FEBio does: at points that come in, four numbers each.
#include <FECore/MathObject.h>

#include <cstdio>
#include <fstream>
#include <string>
#include <vector>

int main(int, char **arguments)
{
    std::vector<MSimpleExpression> expressions;
    std::ifstream file(arguments[1]);
    for (std::string line; std::getline(file, line);) {
        expressions.emplace_back();
        for (const char *name : {"X", "Y", "Z", "t"}) {
            expressions.back().AddVariable(name);
        }
        if (!expressions.back().Create(line, true) || expressions.back().Variables() != 4) {
            std::fprintf(stderr, "refused: %s\n", line.c_str());
            return 1;
        }
    }
    double point[4];
    while (std::fread(point, sizeof point, 1, stdin) == 1) {
        for (const MSimpleExpression &expression : expressions) {
            const double value = expression.value_s(std::vector<double>(point, point + 4));
            std::fwrite(&value, sizeof value, 1, stdout);
        }
    }
    return 0;
}
