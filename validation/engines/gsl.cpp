// GSL's steppers at a constant step: gsl_odeiv2_step_apply, without control of the error.
#include "spring.hpp"
#include <gsl/gsl_errno.h>
#include <gsl/gsl_odeiv2.h>
#include <gsl/gsl_version.h>
#include <map>

static int rhs(double, const double y[], double f[], void *p) {
    const Spring &s = *static_cast<Spring *>(p);
    f[0] = y[1];
    f[1] = -s.k * y[0] / s.m;
    return GSL_SUCCESS;
}

static int jacobian(double, const double[], double *d, double dfdt[], void *p) {
    const Spring &s = *static_cast<Spring *>(p);
    d[0] = 0; d[1] = 1; d[2] = -s.k / s.m; d[3] = 0;
    dfdt[0] = dfdt[1] = 0;
    return GSL_SUCCESS;
}

int main(int n, char **words) {
    if (n < 4) return std::puts("GSL " GSL_VERSION), 0;
    const std::map<std::string, const gsl_odeiv2_step_type *> types = {
        {"rk2", gsl_odeiv2_step_rk2}, {"rk4", gsl_odeiv2_step_rk4}, {"rkf45", gsl_odeiv2_step_rkf45},
        {"rkck", gsl_odeiv2_step_rkck}, {"rk8pd", gsl_odeiv2_step_rk8pd}, {"rk1imp", gsl_odeiv2_step_rk1imp},
        {"rk2imp", gsl_odeiv2_step_rk2imp}, {"rk4imp", gsl_odeiv2_step_rk4imp}};
    Spring s = scene(words[2]);
    gsl_odeiv2_system system = {rhs, jacobian, 2, &s};
    // the implicit ones ask a driver how well they must solve their equations
    auto *driver = gsl_odeiv2_driver_alloc_y_new(&system, types.at(words[1]), s.h, 1e-15, 1e-15);
    double error[2];
    return write(words[3], s, [&](double &q, double &v) {
        double y[2] = {q, v};
        gsl_odeiv2_step_apply(driver->s, 0, s.h, y, error, nullptr, nullptr, &system);
        q = y[0]; v = y[1];
    });
}
