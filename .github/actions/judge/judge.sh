# One command of springcheck for what the JUDGE_ variables name; reports in springcheck-report, a summary for the job.
set -uo pipefail
out=springcheck-report
mkdir -p "$out"
reports=(--junit "$out/junit.xml" --summary "${GITHUB_STEP_SUMMARY:-$out/summary.md}")
read -r -a options <<< "${JUDGE_OPTIONS:-}"
scheme=()
[ -z "${JUDGE_SCHEME:-}" ] || scheme=(--scheme "$JUDGE_SCHEME")

finish() {
  [ -z "${GITHUB_OUTPUT:-}" ] || echo "status=$1" >> "$GITHUB_OUTPUT"
  exit "$1"
}

given=0
for one in "${JUDGE_TRAJECTORY:-}" "${JUDGE_PROGRAM:-}" "${JUDGE_ENGINE:-}"; do
  [ -z "$one" ] || given=$((given + 1))
done
if [ "$given" != 1 ]; then
  echo "springcheck: give one of trajectory, program and engine" >&2
  finish 2
fi
if [ -n "${JUDGE_COMMAND:-}" ] && ! bash -c "$JUDGE_COMMAND"; then
  echo "springcheck: the command that makes the trajectory failed" >&2
  finish 2
fi
status=0
if [ -n "${JUDGE_TRAJECTORY:-}" ]; then
  # of a scene that is stated the judge knows what a bath must do
  verb=(identify "$JUDGE_TRAJECTORY")
  [ -z "${JUDGE_SCENE:-}" ] || verb=(judge "$JUDGE_TRAJECTORY" --scene "$JUDGE_SCENE")
  springcheck "${verb[@]}" ${scheme[@]+"${scheme[@]}"} ${options[@]+"${options[@]}"} "${reports[@]}" || status=$?
  springcheck plot "$JUDGE_TRAJECTORY" -o "$out" --quiet || true
else
  store="$out/run.h5"
  if [ -n "${JUDGE_PROGRAM:-}" ]; then
    brought=(--command "$JUDGE_PROGRAM" ${scheme[@]+"${scheme[@]}"} --method "command:${JUDGE_PROGRAM%%=*}")
  else
    name=$(python -c 'import runpy, sys; print(runpy.run_path(sys.argv[1])["ENGINE"].name)' "$JUDGE_ENGINE") || finish 2
    brought=(--engine "$JUDGE_ENGINE" --method "$name:*")
  fi
  springcheck run "${JUDGE_SCENE:-spring-uneven}" "${brought[@]}" ${options[@]+"${options[@]}"} -o "$store" --force \
    "${reports[@]}" || status=$?
  [ ! -f "$store" ] || springcheck report "$store" -o "$out/report.html" --quiet || true
fi
finish "$status"
