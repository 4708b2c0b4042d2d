#!/bin/sh
# Print the comment on a pull request, whose merge with the base is checked out and built: metrics and two pictures.
set -eu
files="$GITHUB_SERVER_URL/$GITHUB_REPOSITORY/raw"
before=$(git rev-parse HEAD^1) after=$(git rev-parse HEAD^2)

table=$("${DVC:-.venv/bin/dvc}" metrics diff --md "$before")
rows=$(printf '%s\n' "$table" | sed 1,2d) # its own heading names the base by its commit
printf '## Metrics\n\n| file | metric | base | this build | change |\n|---|---|---|---|---|\n%s\n' "${rows:-| none changed |}"

printf '\n## Pictures\n\n| before | after |\n|---|---|\n'
for picture in docs/world.jpg docs/views.jpg; do
    printf '| ![before](%s/%s/%s) | ![after](%s/%s/%s) |\n' "$files" "$before" "$picture" "$files" "$after" "$picture"
done
git diff --quiet HEAD -- docs/world.jpg docs/views.jpg ||
    printf '\nThis build drew other pictures than are committed; its artifact "comment" holds them.\n'
