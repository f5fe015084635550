#!/usr/bin/env bash
# The documentation as a site, with search: docs/site.sh [DIRECTORY]; and every link that leads
# nowhere, in pages and README. Needs mdBook and hyperlink, on the PATH or in $TOOLS.
set -euo pipefail
cd "$(dirname "$0")/.."
PATH=${TOOLS:+$TOOLS:}$PATH

for tool in mdbook hyperlink; do
  if ! command -v "$tool" >/dev/null; then
    echo "docs/site.sh: $tool is absent; 'cargo install --locked $tool' brings it" >&2
    exit 2
  fi
done

# Pages link to worlds, examples and tests of the repository as well: the book is made of a copy
# of what is under version control, laid out as it is here, so that all of these links hold.
site=${1:-target/site}
rm -rf "$site/src" "$site/book"
mkdir -p "$site/src"
git ls-files -z --cached --others --exclude-standard README.md ARCHITECTURE.md CHANGELOG.md LICENSE \
  docs worlds examples tests/regressions crates/stl |
  xargs -0 cp -r --parents --dereference --target-directory "$site/src"
cp docs/book.toml "$site/book.toml"
# The list of pages stands in docs/, as its links say; mdBook reads it one floor up.
sed -e 's#](#](docs/#' -e 's#](docs/\.\./#](#' docs/SUMMARY.md > "$site/src/SUMMARY.md"
rm "$site/src/docs/SUMMARY.md"
# The crate of formulas has two of these pages as links; here they are the same pages.
sed -i 's#](docs/#](../../docs/#' "$site/src/crates/stl/README.md"
rm -r "$site/src/crates/stl/docs"

mdbook build "$site"
# mdBook calls a README index.html, and leaves links to it as they are.
for page in . docs crates/stl; do
  cp "$site/book/$page/index.html" "$site/book/$page/README.html"
done
# A link to a directory leads to a list of what is in it.
find "$site/book" -mindepth 1 -type d ! -exec test -e '{}/index.html' ';' -print |
  while read -r directory; do
    for file in "$directory"/*; do
      printf '<p><a href="%s">%s</a></p>\n' "${file##*/}" "${file##*/}"
    done > "$directory/index.html"
  done
hyperlink "$site/book" --check-anchors
echo "$site/book/index.html"
