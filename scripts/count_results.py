"""Counts test cases from JUnit reports: count_results.py RUNS

RUNS has a line for each run: name, exit status and report, divided by tabs. A run without a
readable report, or that ended badly though its report shows no failure, counts as one failure.
Lists failures and skips; the last line is `N passed, N failed, N skipped`. Exit status 1 if
something failed or nothing passed."""
import sys
import xml.etree.ElementTree as ElementTree


def outcome(case):
    """'passed', 'failed' or 'skipped', and the first line of why."""
    for tag in ("failure", "error"):
        found = case.find(tag)
        if found is not None:
            return "failed", (found.get("message") or found.text or "").strip()
    found = case.find("skipped")
    if found is not None or case.get("result") in ("skipped", "suppressed") or (
            case.get("status") == "notrun"):
        return "skipped", (found.get("message") or found.text or "").strip() if found is not None else ""
    return "passed", ""


def cases_of(name, status, report):
    """[(outcome, test, why)] of one run."""
    try:
        root = ElementTree.parse(report).getroot()
    except (OSError, ElementTree.ParseError) as e:
        late = " (ran out of time)" if status in (124, 137) else ""
        return [("failed", name, "no report, exit status %d%s: %s" % (status, late, e))]
    cases = []
    for case in root.iter("testcase"):
        result, why = outcome(case)
        test = ".".join(x for x in (name, case.get("classname"), case.get("name")) if x)
        cases.append((result, test, why))
    if status and all(result != "failed" for result, _, _ in cases):
        cases.append(("failed", name, "ended with exit status %d" % status))
    if not cases:
        cases.append(("failed", name, "its report holds no test"))
    return cases


def main():
    cases = []
    with open(sys.argv[1]) as runs:
        for line in runs:
            name, status, report = line.rstrip("\n").split("\t")
            cases += cases_of(name, int(status), report)
    for wanted in ("skipped", "failed"):
        for result, test, why in cases:
            if result == wanted:
                print("%s: %s%s" % (result, test, why and " -- " + why.splitlines()[0][:160]))
    count = {w: sum(c[0] == w for c in cases) for w in ("passed", "failed", "skipped")}
    print("%(passed)d passed, %(failed)d failed, %(skipped)d skipped" % count)
    return 0 if count["passed"] and not count["failed"] else 1


if __name__ == "__main__":
    sys.exit(main())
