/* GSL: rk1imp, rk2imp, rk4 and rk4imp return two half steps, rk2 its third order.  apt-get install libgsl-dev;
   cc gsl_half_steps.c -lgsl -lgslcblas -lm */
#include <gsl/gsl_odeiv2.h>
#include <math.h>
#include <stdio.h>
static const double M = 3.7, K = 2.9, H = 0.1;
static int spring(double t, const double y[], double f[], void *user) { return f[0] = y[1] / M, f[1] = -K * y[0], 0; }
static int slopes(double t, const double y[], double *d, double f[], void *user) {
  return d[0] = d[3] = f[0] = f[1] = 0, d[1] = 1 / M, d[2] = -K, 0;
}
static double energy(const double y[]) { return y[1] * y[1] / M + K * y[0] * y[0]; }
static double ran(const gsl_odeiv2_step_type *type) { /* E/E0 after 100 steps */
  gsl_odeiv2_system system = {spring, slopes, 2, 0};
  gsl_odeiv2_driver *driver = gsl_odeiv2_driver_alloc_y_new(&system, type, H, 1e-15, 1e-15);
  double t = 0, y[2] = {0.3, 0.7}, before = energy(y);
  for (int i = 0; i < 100; i++) gsl_odeiv2_step_apply(driver->s, 0, H, y, (double[2]){0, 0}, 0, 0, &system);
  return energy(y) / before;
}
int main(void) { /* a step multiplies the energy by |R(i sqrt(a))|^2, R the method's stability function */
  double a = H * H * K / M, b = a / 4;
  double rk2 = ran(gsl_odeiv2_step_rk2), kutta = pow(1 - a * a / 12 + a * a * a / 36, 100);
  double rk4 = ran(gsl_odeiv2_step_rk4), halves = pow(1 - b * b * b / 72 + b * b * b * b / 576, 200);
  double euler = ran(gsl_odeiv2_step_rk1imp), law = pow(1 + b, -200), promised = pow(1 + a, -100);
  if (fabs(rk2 - kutta) > 1e-13 || fabs(rk4 - halves) > 1e-13) return 1;
  printf("measured %.15f law %.15f uncertainty 1e-13 promised %.15f\n", euler, law, promised);
}
