"""Counts test cases from JUnit reports: count_results.py RUNS

RUNS has a line for each run: name, exit status and report, divided by tabs; the report is a file, or
for rostest the folder with its own report and those of the tests that it ran. A run without a
readable report, or that ended badly though its report shows no failure, counts as one failure.
Lists failures and skips; the last line is `N passed, N failed, N skipped`. Exit status 1 if
something failed or nothing passed."""
import glob
import os
import re
import sys
import xml.etree.ElementTree as ElementTree


def outcome(case):
    """'passed', 'failed' or 'skipped', and why, in one line."""
    for tag in ("failure", "error"):
        found = case.find(tag)
        if found is not None:
            return "failed", reason(found)
    found = case.find("skipped")
    if found is not None or case.get("result") in ("skipped", "suppressed") or (
            case.get("status") == "notrun"):
        return "skipped", "" if found is None else reason(found)
    return "passed", ""


def reason(element):
    """The message of a failure or skip in one line, without the place in the source before it."""
    lines = (element.get("message") or element.text or "").strip().splitlines()
    if len(lines) > 1 and re.search(r":\d+$", lines[0]):
        del lines[0]
    return " ".join(" ".join(lines).split())[:160]


def read(name, report):
    """[(outcome, test, why)] of one file."""
    cases = []
    for case in ElementTree.parse(report).getroot().iter("testcase"):
        result, why = outcome(case)
        test = ".".join(x for x in (name, case.get("classname"), case.get("name")) if x)
        cases.append((result, test, why))
    return cases


def cases_of(name, status, report):
    """[(outcome, test, why)] of one run."""
    try:
        if os.path.isdir(report):
            # rostest's own report has a case for each program that it ran: good to know if the
            # program wrote none.
            cases = read(name, glob.glob(os.path.join(glob.escape(report), "rostest-*.xml"))[0])
            ran = [read(name, path) for path in
                   sorted(glob.glob(os.path.join(glob.escape(report), "rosunit-*.xml")))]
            if ran:
                cases = [c for c in cases if c[0] == "failed"] + sum(ran, [])
        else:
            cases = read(name, report)
    except (OSError, IndexError, ElementTree.ParseError) as e:
        late = " (ran out of time)" if status in (124, 137) else ""
        return [("failed", name, "no report, exit status %d%s: %s" % (status, late, e))]
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
                print("%s: %s%s" % (result, test, why and " -- " + why))
    count = {w: sum(c[0] == w for c in cases) for w in ("passed", "failed", "skipped")}
    print("%(passed)d passed, %(failed)d failed, %(skipped)d skipped" % count)
    return 0 if count["passed"] and not count["failed"] else 1


if __name__ == "__main__":
    sys.exit(main())
