/* erf-model/ERF#3594: the drift by half of the step. */
#include <stdio.h>
int main(void) {
    const double m = 3.7, k = 2.9, h = 0.1;
    double q = 0.3, v = 0.19;
    puts("t,q,v");
    for (int i = 0; i <= 200; i++) {
        printf("%.17g,%.17g,%.17g\n", i * h, q, v);
        v -= h / 2 * k / m * q;
        q += h / 2 * v;
        v -= h / 2 * k / m * q;
    }
}
