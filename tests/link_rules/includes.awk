# Input: paths of source files. Reads each, follows the includes among them, applies the rules.

{
  files[++n_files] = $0
  line = 0
  while ((getline text < $0) > 0) {
    line++
    if (text !~ /^[ \t]*#[ \t]*include/) continue
    where = $0 ":" line
    if (match(text, /<[^>]+>/) || match(text, /"[^"]+"/)) {
      name = substr(text, RSTART + 1, RLENGTH - 2)
      add($0, name, substr(text, RSTART, 1) == "\"")
    } else {
      broken(where ": an include that cannot be read: name the header")
    }
  }
  close($0)
}

function add(file, name, quoted,    thing, ours) {
  ours = inside_any(name, parts)
  if (quoted && !ours) broken(where ": \"" name "\": our headers are included by their path from the root, others in <>")
  if (ours) included[file, ++n_included[file]] = name
  for (thing in things) {
    if (name !~ header_of[thing]) continue
    uses[file, thing] = where
    if (thing in included_in && !inside_any(file, included_in[thing]))
      broken(where ": <" name ">: " thing " is included in " included_in[thing] "/ alone")
    if (file ~ /[.](h|hpp|inl)$/ && thing in in_headers && !inside_any(file, in_headers[thing]))
      broken(where ": <" name ">: " thing " stays in .cpp files (in headers: " in_headers[thing] ")")
  }
}

# Marks everything that `file` includes, however far down, in reached[].
function reach(file,    i) {
  if (file in reached) return
  reached[file] = 1
  for (i = 1; i <= n_included[file]; i++) reach(included[file, i])
}

function judge(file,    folder, n, i, list, other) {
  split("", reached)
  reach(file)
  for (folder in never) {
    if (!governs(folder, file, never)) continue
    n = split(never[folder], list, " ")
    for (other in reached) for (i = 1; i <= n; i++)
      if ((other, list[i]) in uses)
        broken(uses[other, list[i]] ": " list[i] " must not reach " folder "/" (other == file ? "" : " (" file " includes it)"))
  }
  for (folder in only) {
    if (!governs(folder, file, only)) continue
    for (other in reached) if (!inside_any(other, only[folder]))
      broken(file ": includes " other "; " folder "/ may use of ours only: " only[folder])
  }
}

END {
  if (unusable) exit 2
  for (f = 1; f <= n_files; f++) {
    judge(files[f])
    for (thing in once) if ((files[f], thing) in uses) {
      part = files[f]
      sub(/\/.*/, "", part)
      if (inside_any(part, once[thing]) && count[thing, part]++ > 0)
        broken(uses[files[f], thing] ": " thing " is included twice in " part "/")
    }
  }
  if (failures) exit 1
  print n_files " files: include rules hold"
}
