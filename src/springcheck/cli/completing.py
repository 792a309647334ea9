"""`springcheck completion`: a script for shell completion of commands, options, scenes and methods."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from springcheck import checks, engines, schemes
from springcheck.physics import scenefile
from springcheck.studies.arguments import Argument


def script(shell: str, commands: Mapping[str, Sequence[Argument]]) -> str:
    """A script for `eval` or a shell's completion folder, from the names and arguments of `commands`."""
    labels = [f"{name}:{one}" for name in engines.names() for one in engines.engine(name).methods]
    named = {"--method": labels, "--scheme": schemes.known(), "--scene": scenefile.names()}
    words = {"SCENE": scenefile.names(), "NAME": [x.name for x in checks.ALL] + list(schemes.known())}
    cases = []
    for name, arguments in commands.items():
        options = [option for names, _ in arguments for option in names if option.startswith("-")]
        places = [word for names, how in arguments if not names[0].startswith("-")
                  for word in words.get(how.get("metavar", ""), ())]  # fmt: skip
        cases.append(f"    {name}) words='{' '.join([*options, *places])}' ;;")
    after = [f"    {option}) words='{' '.join(known)}' ;;" for option, known in named.items()]
    begin = "autoload -U +X bashcompinit && bashcompinit\n" if shell == "zsh" else ""
    return begin + "\n".join(
        [
            "_springcheck() {",
            "  local cur words before",
            "  cur=${COMP_WORDS[COMP_CWORD]}; before=${COMP_WORDS[COMP_CWORD-1]}; COMPREPLY=()",
            # bash splits words at colons, and every label has one
            "  if declare -F _get_comp_words_by_ref >/dev/null; then _get_comp_words_by_ref -n : cur; fi",
            f"  if [ \"$COMP_CWORD\" -eq 1 ]; then words='{' '.join(commands)}'",
            '  else case "${COMP_WORDS[1]}" in',
            *cases,
            "  esac; fi",
            '  case "$before" in',
            *after,
            "  esac",
            '  COMPREPLY=($(compgen -W "$words" -- "$cur"))',
            '  if declare -F __ltrim_colon_completions >/dev/null; then __ltrim_colon_completions "$cur"; fi',
            "}",
            "complete -o default -F _springcheck springcheck",
        ]
    )
