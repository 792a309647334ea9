# Semi-implicit Euler of one mass on one spring in awk: sh euler.sh SCENE OUT
awk '
function number(name) {
    if (!match(scene, "\"" name "\": [^,}]*")) { print "the scene has no " name > "/dev/stderr"; exit 1 }
    return substr(scene, RSTART + length(name) + 4, RLENGTH - length(name) - 4) + 0
}
{ scene = scene $0 }
END {
    m = number("mass"); k = number("stiffness"); q = number("position"); p = number("momentum")
    h = number("step"); steps = number("steps"); every = number("every")
    printf "t q p\n%.17g %.17g %.17g\n", 0, q, p
    for (i = 1; i <= steps; i++) {
        p -= h * k * q
        q += h * p / m
        if (i % every == 0) printf "%.17g %.17g %.17g\n", i * h, q, p
    }
}' "$1" > "$2"
