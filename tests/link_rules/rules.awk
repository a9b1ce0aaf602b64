# Reads rules.txt, the first file on the command line.

function broken(message) {
  print message
  failures++
}

# Is path (a file or a folder) in folder?
function inside(path, folder) { return path == folder || index(path, folder "/") == 1 }

function inside_any(path, folders,    n, i, list) {
  n = split(folders, list, " ")
  for (i = 1; i <= n; i++) if (inside(path, list[i])) return 1
  return 0
}

# Of the folders that have a rule and hold path, is this the innermost? Its rule alone counts.
function governs(folder, path, rules,    other) {
  if (!inside(path, folder)) return 0
  for (other in rules) if (other != folder && inside(other, folder) && inside(path, other)) return 0
  return 1
}

function rest(from,    i, text) {
  for (i = from; i <= NF; i++) text = text (i > from ? " " : "") $i
  return text
}

function stop(message) {
  print "check: " message > "/dev/stderr"
  unusable = 1
  exit 2
}

FNR == NR {
  if (/^#/ || NF == 0) next
  if ($1 == "thing" && NF == 4) { things[$2] = 1; header_of[$2] = $3; target_of[$2] = $4 }
  else if ($1 == "never" && NF >= 3) never[$2] = rest(3)
  else if ($1 == "only" && NF >= 3) only[$2] = rest(3)
  else if ($1 == "in-headers" && NF >= 3) in_headers[$2] = rest(3)
  else if ($1 == "included-in" && NF >= 3) included_in[$2] = rest(3)
  else if ($1 == "once" && NF >= 3) once[$2] = rest(3)
  else stop("rules.txt:" FNR ": cannot read '" $0 "'")
  next
}
