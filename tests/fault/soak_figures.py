"""Tells from the windows of a soak whether anything in the server grows.

A window is a row of tests/bench/rpc/mixed_load (run with --null), and of the
server, at its end: resident_kb, files (open ones), mission_kb (its file's).
"""

import statistics

# Growth of memory from the second to the last quarter of the windows that
# still counts as none: what the mission file grew by meanwhile (SQLite caches
# up to 16 MiB of it) and allocator noise. A leak of 100 bytes a ping would show
# 1.9 MB in a minute of windows (1600 pings in 5 s); the first quarter fills the
# histories in the map.
GROWTH_KB_PER_MINUTE = 1536


def judge(rows, window_s, server_exit_code):
    """Compares the second with the last quarter of the windows, in each of
    which the server was asked and loaded for window_s seconds. Returns (good,
    figures); figures name what is wrong."""
    size = len(rows) // 4
    early, late = rows[size:2 * size], rows[3 * size:4 * size]
    between_minutes = 2 * size * window_s / 60

    def growth(key):
        first, last = (statistics.mean(row[key] for row in quarter)
                       for quarter in (early, late))
        return (last - first) / between_minutes

    def medians(key):
        return [round(statistics.median(row[key] for row in quarter))
                for quarter in (early, late)]

    query_us = medians("query_p99_us")
    null_us = medians("null_query_p99_us")
    wrong = []
    if (growth("resident_kb") >
            GROWTH_KB_PER_MINUTE + max(0, growth("mission_kb"))):
        wrong.append("memory grows")
    if rows[-1]["files"] > rows[0]["files"] + 2:
        wrong.append("open files grow")
    # Other work that came on meanwhile made the null server slower as well,
    # which keeps nothing that could grow: that factor is not ours (three busy
    # loops: ours 0.8 to 5.9 ms, the null server's 0.6 to 3.5).
    allowed_us = 2 * query_us[0]
    by_machine = max(1, null_us[1] / null_us[0])
    if query_us[1] > allowed_us * by_machine:
        wrong.append("query p99 grows")
    if server_exit_code != 0:
        wrong.append("the server's exit code")
    return not wrong, {
        "windows": len(rows),
        "pings": sum(row["pings"] for row in rows),
        "resident_kb": rows[-1]["resident_kb"],
        "growth_kb_per_minute": round(growth("resident_kb")),
        "file_growth_kb_per_minute": round(growth("mission_kb")),
        "files": [rows[0]["files"], rows[-1]["files"]],
        "query_p99_us": query_us,
        "null_query_p99_us": null_us,
        "p99_excused_by_null":
            allowed_us < query_us[1] <= allowed_us * by_machine,
        "ack_p99_ms": round(statistics.median(row["ack_p99_ms"]
                                              for row in rows), 1),
        "server_exit_code": server_exit_code,
        "wrong": wrong,
    }
