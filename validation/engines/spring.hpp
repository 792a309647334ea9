// What the programs of this folder share: one mass on one spring, read from the scene that a command is given.
//   ./gsl rk4 scene.json states.csv      ./gsl --version
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <functional>
#include <sstream>
#include <string>

struct Spring { double m, k, h, q, v; long steps, every; };
using Step = std::function<void(double &, double &)>;  // q and v, moved on by one step

inline Spring scene(const char *path) {
    std::ifstream file(path);
    std::stringstream all;
    all << file.rdbuf();
    const std::string text = all.str();
    auto number = [&](const char *name) {
        const auto at = text.find('"' + std::string(name) + "\":");
        if (at == std::string::npos) { std::fprintf(stderr, "no %s\n", name); std::exit(2); }
        return std::strtod(text.c_str() + at + std::strlen(name) + 3, nullptr);
    };
    const double m = number("mass");
    return {m, number("stiffness"), number("step"), number("position"), number("momentum") / m,
            long(number("steps")), long(number("every"))};
}

inline int write(const char *path, const Spring &s, const Step &step) {
    std::FILE *out = std::fopen(path, "w");
    if (!out || !step) return 2;
    double q = s.q, v = s.v;
    std::fputs("t,q,v\n", out);
    for (long i = 0; i <= s.steps; i++) {
        if (i % s.every == 0) std::fprintf(out, "%.17g,%.17g,%.17g\n", i * s.h, q, v);
        step(q, v);
    }
    return std::fclose(out);
}
