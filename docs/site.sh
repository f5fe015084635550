#!/usr/bin/env bash
# The documentation as a site, with search: docs/site.sh [DIRECTORY]. It fails at a link that
# leads nowhere. Needs mdBook 0.5 or later and Python 3, on the PATH or in $TOOLS.
set -euo pipefail
cd "$(dirname "$0")/.."
PATH=${TOOLS:+$TOOLS:}$PATH

missing() {
  echo "docs/site.sh: $1 is missing" >&2
  echo "  help: install it with '$2', or name its directory in \$TOOLS" >&2
  exit 2
}
command -v mdbook >/dev/null || missing mdbook 'cargo install --locked mdbook'
command -v python3 >/dev/null || missing python3 'apt-get install python3'

# Pages link to worlds, examples and tests of the repository as well: the book is made of a copy
# of what is under version control, laid out as it is here, so that all of these links hold.
site=${1:-target/site}
rm -rf "$site/src" "$site/book"
mkdir -p "$site/src"
git ls-files -z --cached --others --exclude-standard README.md ARCHITECTURE.md CHANGELOG.md \
  CONTRIBUTING.md LICENSE docs worlds examples python tests/regressions crates/stl crates/repro .ci |
  xargs -0 cp -r --parents --dereference --target-directory "$site/src"
cp docs/book.toml "$site/book.toml"
# The list of pages is in docs/, as its links are; mdBook reads it one directory up.
sed -e 's#](#](docs/#' -e 's#](docs/\.\./#](#' docs/SUMMARY.md > "$site/src/SUMMARY.md"
rm "$site/src/docs/SUMMARY.md"
# The program prints the tables of its reference.
tables=docs/reference/tables
mkdir "$site/src/$tables"
printf '\n# Tables that the program prints\n\n' >> "$site/src/SUMMARY.md"
for topic in $(cargo run --quiet --release -- reference | sed -n 's/^| `\(.*\)` |.*/\1/p'); do
  cargo run --quiet --release -- reference "$topic" > "$site/src/$tables/$topic.md"
  printf -- '- [%s](%s)\n' "$topic" "$tables/$topic.md" >> "$site/src/SUMMARY.md"
done
# The other README files are no chapters, but pages link to them.
printf '\n# Outside the book\n\n- [egos of other projects](examples/egos/README.md)\n- [the wheel](python/README.md)\n' \
  >> "$site/src/SUMMARY.md"
# The crate of formulas has a link to its page; here it is the same page.
sed -i 's#](docs/#](../../docs/reference/#' "$site/src/crates/stl/README.md"
rm -r "$site/src/crates/stl/docs"

mdbook build "$site"
# mdBook puts the first page on top as well, where its links would lead nowhere.
echo '<meta http-equiv="refresh" content="0; url=docs/README.html">' > "$site/book/index.html"
# A link to a directory leads to a list of its files.
find "$site/book" -mindepth 1 -type d ! -exec test -e '{}/index.html' ';' -print |
  while read -r directory; do
    for file in "$directory"/*; do
      printf '<p><a href="%s">%s</a></p>\n' "${file##*/}" "${file##*/}"
    done > "$directory/index.html"
  done

python3 - "$site/book" <<'CHECK'
import html.parser, pathlib, sys, urllib.parse

class Page(html.parser.HTMLParser):
    def __init__(self, path):
        super().__init__()
        self.links, self.anchors = [], set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.anchors.update(attributes.get(key) for key in ("id", "name"))
        self.links += [attributes[key] for key in ("href", "src") if attributes.get(key)]

book = pathlib.Path(sys.argv[1]).resolve()
pages = {path: Page(path) for path in book.rglob("*.html")}
dead = []
for path, page in pages.items():
    if path.name in ("print.html", "404.html", "toc.html"):
        continue
    for link in page.links:
        url = urllib.parse.urlsplit(link)
        if url.scheme or url.netloc:
            continue
        target = (path.parent / urllib.parse.unquote(url.path)).resolve() if url.path else path
        target = target / "index.html" if target.is_dir() else target
        anchor = urllib.parse.unquote(url.fragment)
        if not target.exists() or anchor and target in pages and anchor not in pages[target].anchors:
            dead.append(f"{path.relative_to(book)}: {link}")
print(f"{len(pages)} pages, {len(dead)} dead links", *sorted(set(dead)), sep="\n", file=sys.stderr)
sys.exit(bool(dead))
CHECK
echo "$site/book/index.html"
