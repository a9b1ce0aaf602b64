# Input: "<folder> <target> <linked target> <its folder, or ->".

NF != 4 { stop("line " FNR ": cannot read '" $0 "'") }

{
  n_links++
  for (folder in only) if (inside($1, folder)) seen[folder] = 1
  targets[$2] = 1
  for (folder in never) {
    if (!governs(folder, $1, never)) continue
    n = split(never[folder], list, " ")
    for (i = 1; i <= n; i++)
      if (tolower($3) ~ target_of[list[i]]) broken($2 " links " $3 ": " list[i] " must not reach " folder "/")
  }
  if ($4 == "-") next
  for (folder in only)
    if (governs(folder, $1, only) && !inside_any($4, only[folder]))
      broken($2 " links " $3 " (" $4 "); " folder "/ may use of ours only: " only[folder])
}

END {
  if (unusable) exit 2
  for (folder in only) if (!(folder in seen)) stop("no target in " folder "/: rules would hold for nothing")
  if (failures) exit 1
  for (target in targets) n_targets++
  print n_targets " targets, " n_links " links: link rules hold"
}
