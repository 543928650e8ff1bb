// Evaluates expressions with fparser, the parser of MOOSE: reads lines of expressions in x, y, z and t from the file that is named, points as
// doubles from standard input, and writes the values of all expressions at each point.
#include <fparser.hh>

#include <cstdio>
#include <fstream>
#include <string>
#include <vector>

int main(int, char **arguments)
{
    std::vector<FunctionParser> parsers;
    std::ifstream file(arguments[1]);
    for (std::string line; std::getline(file, line);) {
        FunctionParser parser;
        if (parser.Parse(line, "x,y,z,t") >= 0) {
            std::fprintf(stderr, "%s: %.200s\n", parser.ErrorMsg(), line.c_str());
            return 1;
        }
        parsers.push_back(parser);
    }
    double point[4];
    while (std::fread(point, sizeof point, 1, stdin) == 1) {
        for (auto &parser : parsers) {
            const double value = parser.Eval(point);
            std::fwrite(&value, sizeof value, 1, stdout);
        }
    }
    return 0;
}
