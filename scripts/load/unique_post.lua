-- wrk: POST of the same recording again and again, no two alike: a counter replaces MARK, so that no upload finds its
-- bytes stored already. Arguments: file, content type, key, mark (plain text of eight or more digits).

local next_thread = 0

function setup(thread)
  next_thread = next_thread + 1
  thread:set("number", next_thread)
end

function init(args)
  local file = assert(io.open(args[1], "rb"))
  local body = file:read("*a")
  file:close()
  local from, to = string.find(body, args[4], 1, true)
  assert(from, "the mark is not in the file")
  head, tail, width = body:sub(1, from - 1), body:sub(to + 1), to - from + 1
  counter = 0
  wrk.method = "POST"
  wrk.headers["Content-Type"] = args[2]
  wrk.headers["Authorization"] = "Bearer " .. args[3]
end

function request()
  counter = counter + 1
  local mark = string.format("%02d%0" .. (width - 2) .. "d", number, counter)
  return wrk.format(nil, nil, nil, head .. mark .. tail)
end
