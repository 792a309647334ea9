/* Velocity Verlet of one mass on one spring, as a program for `springcheck run --command`.
   cc -O2 -o verlet verlet.c;  springcheck run spring --command 'c=./verlet {scene} {out}' --scheme velocity-verlet */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static double number(const char *scene, const char *name) {
    const char *found = strstr(scene, name);
    if (!found) {
        fprintf(stderr, "the scene has no %s: it is not one mass on one spring\n", name);
        exit(1);
    }
    return strtod(found + strlen(name), NULL);
}

int main(int argc, char **argv) {
    static char scene[1 << 20];
    FILE *in = argc == 3 ? fopen(argv[1], "r") : NULL;
    if (!in) return 2;
    scene[fread(scene, 1, sizeof scene - 1, in)] = 0;
    double m = number(scene, "\"mass\": "), k = number(scene, "\"stiffness\": ");
    double q = number(scene, "\"position\": "), p = number(scene, "\"momentum\": ");
    double h = number(scene, "\"step\": ");
    long steps = (long)number(scene, "\"steps\": "), every = (long)number(scene, "\"every\": ");
    FILE *out = fopen(argv[2], "w");
    fprintf(out, "t,q,p\n%.17g,%.17g,%.17g\n", 0.0, q, p);
    for (long i = 1; i <= steps; i++) {
        p -= h / 2 * (k * q);
        q += h * p / m;
        p -= h / 2 * (k * q);
        if (i % every == 0) fprintf(out, "%.17g,%.17g,%.17g\n", i * h, q, p);
    }
    return fclose(out);
}
