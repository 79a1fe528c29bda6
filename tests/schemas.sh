#!/usr/bin/env bash
# Checks the files that GitHub reads against their schemas, with check-jsonschema from PATH. Needs no network: the schemas are
# part of that program.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

check() {
    check-jsonschema --builtin-schema "$@"
}

check vendor.github-workflows .github/workflows/*.yml
check vendor.github-issue-forms .github/ISSUE_TEMPLATE/{bug,feature}.yml
check vendor.github-issue-config .github/ISSUE_TEMPLATE/config.yml
check vendor.dependabot .github/dependabot.yml
check vendor.citation-file-format CITATION.cff
