// chaos-polymtl/lethe#2082: velocity Verlet had become symplectic Euler.
#include <cstdio>
int main() {
    const double m = 3.7, k = 2.9, h = 0.1;
    double q = 0.3, v = 0.19;
    std::puts("t,q,v");
    for (int i = 0; i <= 200; i++) {
        std::printf("%.17g,%.17g,%.17g\n", i * h, q, v);
        v -= h * k / m * q;
        q += h * v;
    }
}
