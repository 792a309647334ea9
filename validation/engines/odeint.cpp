// Boost.odeint's steppers at a constant step.
#include "spring.hpp"
#include <array>
#include <boost/numeric/odeint.hpp>
#include <boost/numeric/odeint/stepper/symplectic_rkn_sb3a_m4_mclachlan.hpp>
#include <boost/version.hpp>
#include <utility>

using namespace boost::numeric::odeint;
using State = std::array<double, 2>;
using One = std::array<double, 1>;
using Vector = boost::numeric::ublas::vector<double>;
using Matrix = boost::numeric::ublas::matrix<double>;

template <class Stepper> Step explicit_(const Spring &s) {
    return [s, stepper = Stepper()](double &q, double &v) mutable {
        State y = {q, v};
        stepper.do_step([&](const State &y, State &f, double) { f = {y[1], -s.k * y[0] / s.m}; }, y, 0.0, s.h);
        q = y[0]; v = y[1];
    };
}

template <class Stepper> Step symplectic(const Spring &s) {
    return [s, stepper = Stepper()](double &q, double &v) mutable {
        One x = {q}, p = {v};
        auto drift = [](const One &p, One &f) { f = p; };
        auto kick = [&](const One &x, One &f) { f = {-s.k * x[0] / s.m}; };
        stepper.do_step(std::make_pair(drift, kick), std::make_pair(std::ref(x), std::ref(p)), 0.0, s.h);
        q = x[0]; v = p[0];
    };
}

static Step verlet(const Spring &s) {
    return [s, stepper = velocity_verlet<One>(), begun = false](double &q, double &v) mutable {
        One x = {q}, p = {v};
        auto pull = [&](const One &x, const One &, One &a, double) { a = {-s.k * x[0] / s.m}; };
        if (!begun) stepper.initialize(pull, x, p, 0.0);
        begun = true;
        stepper.do_step(pull, std::make_pair(std::ref(x), std::ref(p)), 0.0, s.h);
        q = x[0]; v = p[0];
    };
}

template <class Stepper> Step implicit(const Spring &s, Stepper stepper) {
    return [s, stepper](double &q, double &v) mutable {
        Vector y(2), f(2);
        y[0] = q; y[1] = v;
        auto rhs = [&](const Vector &y, Vector &f, double) { f[0] = y[1]; f[1] = -s.k * y[0] / s.m; };
        auto jacobian = [&](const Vector &, Matrix &d, double, auto &...t) {
            d(0, 0) = d(1, 1) = 0; d(0, 1) = 1; d(1, 0) = -s.k / s.m;
            ((t[0] = t[1] = 0), ...);
        };
        if constexpr (std::is_same_v<Stepper, implicit_euler<double>>)
            stepper.do_step(std::make_pair(rhs, [&](const Vector &y, Matrix &d, double t) { jacobian(y, d, t); }), y, 0.0, s.h);
        else
            stepper.do_step(std::make_pair(rhs, [&](const Vector &y, Matrix &d, const double &t, Vector &dt) { jacobian(y, d, t, dt); }), y, 0.0, f, s.h, *std::make_unique<Vector>(2));
        q = y[0]; v = y[1];
    };
}

int main(int n, char **words) {
    if (n < 4) return std::printf("Boost.odeint %d.%d\n", BOOST_VERSION / 100000, BOOST_VERSION / 100 % 1000), 0;
    const Spring s = scene(words[2]);
    const std::string name = words[1];
    const Step step =
        name == "euler" ? explicit_<euler<State>>(s)
        : name == "modified-midpoint" ? explicit_<modified_midpoint<State>>(s)
        : name == "runge-kutta4" ? explicit_<runge_kutta4<State>>(s)
        : name == "cash-karp54" ? explicit_<runge_kutta_cash_karp54<State>>(s)
        : name == "dopri5" ? explicit_<runge_kutta_dopri5<State>>(s)
        : name == "fehlberg78" ? explicit_<runge_kutta_fehlberg78<State>>(s)
        : name == "symplectic-euler" ? symplectic<symplectic_euler<One>>(s)
        : name == "mclachlan" ? symplectic<symplectic_rkn_sb3a_mclachlan<One>>(s)
        : name == "m4-mclachlan" ? symplectic<symplectic_rkn_sb3a_m4_mclachlan<One>>(s)
        : name == "velocity-verlet" ? verlet(s)
        : name == "implicit-euler" ? implicit(s, implicit_euler<double>(1e-15))
        : Step();
    return write(words[3], s, step);
}
