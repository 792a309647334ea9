# deSolve: an embedded method with varstep=FALSE uses the first column of its matrix A alone.
# apt-get install r-cran-desolve; Rscript desolve_fixed_step.R
library(deSolve)
M <- 3.7; K <- 2.9; H <- 0.1; N <- 100
f <- function(t, y, p) list(c(y[2] / M, -K * y[1]))
energy <- function(y) (y[2]^2 / M + K * y[1]^2) / 2
START <- c(0.3, 0.7)
stepped <- function(A, b) { # E/E0 after N steps of the method of A and b
  y <- START
  for (n in 1:N) {
    k <- matrix(0, length(b), 2)
    for (j in seq_along(b)) k[j, ] <- f(0, y + H * colSums(A[j, ] * k), 0)[[1]]
    y <- y + H * colSums(b * k)
  }
  energy(y) / energy(START)
}
ode45 <- rkMethod("ode45", varstep = FALSE)
measured <- energy(rk(START, (0:N) * H, f, 0, method = ode45)[N + 1, 2:3]) / energy(START)
whole <- cbind(ode45$A, 0)
first <- 0 * whole # the law: A[j, 1] before the stage just before, and nothing else
for (j in 2:ode45$stage) first[j, j - 1] <- whole[j, 1]
law <- stepped(first, ode45$b1)
cat(sprintf("measured %.15f law %.15f uncertainty 1e-13 promised %.15f\n", measured, law, stepped(whole, ode45$b1)))
