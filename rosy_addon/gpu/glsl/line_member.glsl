uniform int degree, sheet_count;

// The member on a line. For odd N, every other line is the opposite half of a member.
int line_member(int line)
{
  bool halves = sheet_count > degree && (degree & 1) == 1;
  return halves ? ((line & 1) == 0 ? line / 2 : (line + degree) / 2) : line;
}
