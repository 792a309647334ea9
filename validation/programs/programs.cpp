// A JSON line of each method of GSL and Boost odeint.  g++ -std=c++17 programs.cpp -lgsl -lgslcblas
#include <cstdio>
#include <vector>
#include <string>
#include <gsl/gsl_odeiv2.h>
#include <gsl/gsl_errno.h>
#include <boost/numeric/odeint.hpp>
#include <boost/numeric/ublas/vector.hpp>
#include <boost/numeric/ublas/matrix.hpp>
using namespace std; namespace o = boost::numeric::odeint;
const double M=3.7,K=2.9,Q=0.3,V=0.19,H=0.1,W2=K/M; const int N=60;
typedef vector<double> S;
void out(const char*name,const char*scheme,const S&q,const S&v){printf("{\"name\":\"%s\",\"scheme\":\"%s\",\"h\":0.1,\"m\":3.7,\"k\":2.9,\"q\":[",name,scheme);
 for(size_t i=0;i<q.size();i++)printf("%s%.17g",i?",":"",q[i]);printf("],\"v\":[");for(size_t i=0;i<v.size();i++)printf("%s%.17g",i?",":"",v[i]);printf("]}\n");}
int f(double,const double y[],double d[],void*){d[0]=y[1];d[1]=-W2*y[0];return 0;}
int jac(double,const double y[],double*J,double*dt,void*){J[0]=0;J[1]=1;J[2]=-W2;J[3]=0;dt[0]=dt[1]=0;return 0;}
void gsl(const gsl_odeiv2_step_type*T,const char*name,const char*scheme){
 gsl_odeiv2_system s={f,jac,2,0};
 gsl_odeiv2_driver*d=gsl_odeiv2_driver_alloc_y_new(&s,T,H,0.05,0.05);
 double y[2]={Q,V},t=0;S q{Q},v{V};
 for(int i=0;i<N;i++){ int r=gsl_odeiv2_driver_apply_fixed_step(d,&t,H,1,y); if(r){fprintf(stderr,"%s %s\n",name,gsl_strerror(r));return;} q.push_back(y[0]);v.push_back(y[1]);}
 out(name,scheme,q,v);}
template<class St> void rk(St st,const char*name,const char*scheme){S y{Q,V},q{Q},v{V};double t=0;
 auto g=[](const S&y,S&d,double){d[0]=y[1];d[1]=-W2*y[0];};
 for(int i=0;i<N;i++){st.do_step(g,y,t,H);t+=H;q.push_back(y[0]);v.push_back(y[1]);}out(name,scheme,q,v);}
template<class St> void sy(St st,const char*name,const char*scheme,bool){S x{Q},p{M*V},q{Q},v{V};double t=0;
 for(int i=0;i<N;i++){st.do_step(make_pair([](const S&p,S&dq){dq[0]=p[0]/M;},[](const S&q,S&dp){dp[0]=-K*q[0];}),make_pair(ref(x),ref(p)),t,H);t+=H;q.push_back(x[0]);v.push_back(p[0]/M);}out(name,scheme,q,v);}
int main(){ gsl_set_error_handler_off();
 gsl(gsl_odeiv2_step_rk2,"GSL 2.7, rk2","rk3-kutta");gsl(gsl_odeiv2_step_rk4,"GSL 2.7, rk4","rk4:2");
 gsl(gsl_odeiv2_step_rkf45,"GSL 2.7, rkf45","fehlberg5");gsl(gsl_odeiv2_step_rkck,"GSL 2.7, rkck","cash-karp5");gsl(gsl_odeiv2_step_rk8pd,"GSL 2.7, rk8pd","exact");
 gsl(gsl_odeiv2_step_rk1imp,"GSL 2.7, rk1imp","implicit-euler:2");gsl(gsl_odeiv2_step_rk2imp,"GSL 2.7, rk2imp","implicit-midpoint:2");gsl(gsl_odeiv2_step_rk4imp,"GSL 2.7, rk4imp","gauss4:2");
 gsl(gsl_odeiv2_step_bsimp,"GSL 2.7, bsimp","exact");gsl(gsl_odeiv2_step_msadams,"GSL 2.7, msadams","adaptive");
 rk(o::euler<S>(),"Boost odeint, euler","explicit-euler");rk(o::runge_kutta4<S>(),"Boost odeint, runge_kutta4","rk4");rk(o::runge_kutta4_classic<S>(),"Boost odeint, runge_kutta4_classic","rk4");
 rk(o::modified_midpoint<S>(2),"Boost odeint, modified_midpoint(2)","order 2");rk(o::adams_bashforth<2,S>(),"Boost odeint, adams_bashforth 2","memory");rk(o::adams_bashforth_moulton<3,S>(),"Boost odeint, adams_bashforth_moulton 3","memory");
 rk(o::runge_kutta_cash_karp54<S>(),"Boost odeint, cash_karp54","cash-karp5");rk(o::runge_kutta_fehlberg78<S>(),"Boost odeint, fehlberg78","exact");
 {o::runge_kutta_dopri5<S> st; S y{Q,V},q{Q},v{V};auto g=[](const S&y,S&d,double){d[0]=y[1];d[1]=-W2*y[0];};double t=0;for(int i=0;i<N;i++){st.do_step(g,y,t,H);t+=H;q.push_back(y[0]);v.push_back(y[1]);}out("Boost odeint, dopri5","dormand-prince5",q,v);}
 sy(o::symplectic_euler<S>(),"Boost odeint, symplectic_euler","semi-implicit-euler-drift-kick",0);
 sy(o::symplectic_rkn_sb3a_mclachlan<S>(),"Boost odeint, symplectic_rkn_sb3a_mclachlan","symmetric",0);
 {o::velocity_verlet<S> st; S x{Q},p{V},q{Q},v{V};double t=0; for(int i=0;i<N;i++){st.do_step([](const S&q,const S&,S&a,double){a[0]=-W2*q[0];},make_pair(ref(x),ref(p)),t,H);t+=H;q.push_back(x[0]);v.push_back(p[0]);}out("Boost odeint, velocity_verlet","velocity-verlet",q,v);}
 {typedef boost::numeric::ublas::vector<double> U;typedef boost::numeric::ublas::matrix<double> Mx; U y(2);y[0]=Q;y[1]=V;S q{Q},v{V};double t=0;
  auto g=[](const U&y,U&d,double){d[0]=y[1];d[1]=-W2*y[0];};auto J=[](const U&,Mx&J,double){J(0,0)=0;J(0,1)=1;J(1,0)=-W2;J(1,1)=0;};
  o::implicit_euler<double> st; for(int i=0;i<N;i++){st.do_step(make_pair(g,J),y,t,H);t+=H;q.push_back(y[0]);v.push_back(y[1]);}out("Boost odeint, implicit_euler","implicit-euler",q,v);}
 {typedef boost::numeric::ublas::vector<double> U;typedef boost::numeric::ublas::matrix<double> Mx; U y(2);y[0]=Q;y[1]=V;S q{Q},v{V};double t=0;
  auto g=[](const U&y,U&d,double){d[0]=y[1];d[1]=-W2*y[0];};auto J=[](const U&,Mx&J,const double&,U&dt){J(0,0)=0;J(0,1)=1;J(1,0)=-W2;J(1,1)=0;dt[0]=dt[1]=0;};
  o::rosenbrock4<double> st; for(int i=0;i<N;i++){st.do_step(make_pair(g,J),y,t,H);t+=H;q.push_back(y[0]);v.push_back(y[1]);}out("Boost odeint, rosenbrock4","order 4",q,v);}
}
