# A JSON line of each method of deSolve.  Rscript programs.R
library(deSolve)
M <- 3.7; K <- 2.9; H <- 0.1; N <- 60
f <- function(t, y, p) list(c(y[2], -K/M*y[1]))
out <- function(name, scheme, a) cat(sprintf('{"name":"%s","scheme":"%s","h":0.1,"m":3.7,"k":2.9,"q":[%s],"v":[%s]}\n', name, scheme, paste(sprintf("%.17g", a[,2]), collapse=","), paste(sprintf("%.17g", a[,3]), collapse=",")))
t <- (0:N)*H; y <- c(0.3, 0.19)
out("deSolve 1.34, euler", "explicit-euler", ode(y, t, f, NULL, method="euler"))
out("deSolve 1.34, rk4", "rk4", ode(y, t, f, NULL, method="rk4"))
kinds <- c(rk2="rk2-midpoint", rk23="rk2-midpoint", rk23bs="order 1", rk34f="order 1", rk45f="order 1",
           rk45ck="order 1", rk45dp7="order 1", irk3r="constant", irk5r="constant", irk4hh="constant",
           irk4l="constant")
for (n in names(kinds)) {
  out(paste0("deSolve 1.34, ", n), kinds[[n]], rk(y, t, f, NULL, method=rkMethod(n, varstep=FALSE), hini=H))
}
for (n in c("lsoda","lsode","bdf","adams","radau","daspk","vode","impAdams")) out(paste0("deSolve 1.34, ", n), "adaptive", ode(y, t, f, NULL, method=n, rtol=1e-6, atol=1e-9))
