// headmyshoulder/odeint-v2#150: q + h/2 v + h^2 a, the halves swapped.
#include <cstdio>
int main() {
    const double m = 3.7, k = 2.9, h = 0.1;
    double q = 0.3, v = 0.19, a = -k / m * q;
    std::puts("t,q,v");
    for (int i = 0; i <= 200; i++) {
        std::printf("%.17g,%.17g,%.17g\n", i * h, q, v);
        q += h / 2 * v + h * h * a;
        const double b = -k / m * q;
        v += h / 2 * (a + b);
        a = b;
    }
}
