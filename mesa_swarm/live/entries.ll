; What pages call, and what Numba's code needs of its runtime: written by hand, in LLVM's language.
; Names in double braces are those of compiled functions.

declare i32 @"{{drive_steps}}"(ptr, ptr, ptr, ptr, i64, i64, ptr, i64, i64, i64, i64, i64, i64)
declare i32 @"{{remainder_of}}"(ptr, ptr, double, double)
declare i32 @"{{next_word}}"(ptr, ptr, ptr, ptr, i64, i64, ptr, i64, i64)

; The code that a call returns where a function has raised an error.
define i32 @raised(i32 %status, ptr %result) {
  %fine = icmp eq i32 %status, 0
  br i1 %fine, label %done, label %failed
done:
  %code = load i64, ptr %result
  %small = trunc i64 %code to i32
  ret i32 %small
failed:
  ret i32 -2147483648
}

; Take steps: see `drive_steps`.
define i32 @drive(i32 %block, i32 %length, i32 %steps, i32 %completed, i32 %begun, i32 %rows) {
  %result = alloca i64
  %error = alloca ptr
  %array = inttoptr i32 %block to ptr
  %n = zext i32 %length to i64
  %s = sext i32 %steps to i64
  %c = sext i32 %completed to i64
  %b = sext i32 %begun to i64
  %r = sext i32 %rows to i64
  %status = call i32 @"{{drive_steps}}"(ptr %result, ptr %error, ptr null, ptr null, i64 %n, i64 8, ptr %array, i64 %n, i64 8, i64 %s, i64 %c, i64 %b, i64 %r)
  %code = call i32 @raised(i32 %status, ptr %result)
  ret i32 %code
}

; Call the kernel at a place of the table.
define i32 @call_kernel(i32 %place, i32 %block, i32 %length, i32 %step, i32 %first, i32 %last) {
  %result = alloca i64
  %error = alloca ptr
  %array = inttoptr i32 %block to ptr
  %function = inttoptr i32 %place to ptr
  %n = zext i32 %length to i64
  %s = sext i32 %step to i64
  %f = sext i32 %first to i64
  %l = sext i32 %last to i64
  %status = call i32 %function(ptr %result, ptr %error, ptr null, ptr null, i64 %n, i64 8, ptr %array, i64 %n, i64 8, i64 %s, i64 %f, i64 %l)
  %code = call i32 @raised(i32 %status, ptr %result)
  ret i32 %code
}

; The two functions that draw, as NumPy's: of the address of a state, which are four words here.
define i64 @draw_word(ptr %state) {
  %result = alloca i64
  %error = alloca ptr
  %status = call i32 @"{{next_word}}"(ptr %result, ptr %error, ptr null, ptr null, i64 4, i64 8, ptr %state, i64 4, i64 8)
  %word = load i64, ptr %result
  ret i64 %word
}

define double @draw_number(ptr %state) {
  %word = call i64 @draw_word(ptr %state)
  %bits = lshr i64 %word, 11
  %whole = uitofp i64 %bits to double
  %number = fmul double %whole, 0x3CA0000000000000
  ret double %number
}

; Memory for arrays that a function makes: the end of what is in use goes back where nothing is in use any more.
@heap = internal global i32 0
@next = internal global i32 0
@used = internal global i32 0

define void @begin_heap(i32 %address) {
  store i32 %address, ptr @heap
  store i32 %address, ptr @next
  store i32 0, ptr @used
  ret void
}

; The address behind what was ever in use is checked by pages.
@farthest = internal global i32 0

define i32 @heap_end() {
  %end = load i32, ptr @farthest
  ret i32 %end
}

define ptr @NRT_MemInfo_alloc_aligned(i64 %size, i32 %align) {
  %used = load i32, ptr @used
  %none = icmp eq i32 %used, 0
  %last = load i32, ptr @next
  %first = load i32, ptr @heap
  %info = select i1 %none, i32 %first, i32 %last
  %more = add i32 %used, 1
  store i32 %more, ptr @used
  %behind = add i32 %info, 127
  %data = and i32 %behind, -64
  %bytes = trunc i64 %size to i32
  %end = add i32 %data, %bytes
  %rounded = add i32 %end, 63
  %next = and i32 %rounded, -64
  store i32 %next, ptr @next
  %before = load i32, ptr @farthest
  %farther = icmp ugt i32 %next, %before
  %peak = select i1 %farther, i32 %next, i32 %before
  store i32 %peak, ptr @farthest
  call void @make_room(i32 %peak)
  %meminfo = inttoptr i32 %info to ptr
  %address = inttoptr i32 %data to ptr
  ; struct MemInfo: references, destructor and its argument, data, size, allocator
  store i64 1, ptr %meminfo
  %at = getelementptr i8, ptr %meminfo, i32 16
  store ptr %address, ptr %at
  ret ptr %meminfo
}

; Memory grows by whole pages of 64 KiB.
declare i32 @llvm.wasm.memory.size.i32(i32)
declare i32 @llvm.wasm.memory.grow.i32(i32, i32)

define void @make_room(i32 %end) {
  %pages = call i32 @llvm.wasm.memory.size.i32(i32 0)
  %size = shl i32 %pages, 16
  %fits = icmp ult i32 %end, %size
  br i1 %fits, label %done, label %grow
grow:
  %lacking = sub i32 %end, %size
  %whole = lshr i32 %lacking, 16
  %count = add i32 %whole, 16
  %old = call i32 @llvm.wasm.memory.grow.i32(i32 0, i32 %count)
  br label %done
done:
  ret void
}

; The other ways in which Numba asks for memory.
define ptr @NRT_MemInfo_alloc(i64 %size) {
  %info = call ptr @NRT_MemInfo_alloc_aligned(i64 %size, i32 16)
  ret ptr %info
}

define ptr @NRT_MemInfo_new_varsize_dtor(i64 %size, ptr %dtor) {
  %info = call ptr @NRT_MemInfo_alloc_aligned(i64 %size, i32 16)
  ret ptr %info
}

define ptr @NRT_Allocate(i64 %size) {
  %info = call ptr @NRT_MemInfo_alloc_aligned(i64 %size, i32 16)
  %at = getelementptr i8, ptr %info, i32 16
  %data = load ptr, ptr %at
  ret ptr %data
}

define void @NRT_Free(ptr %data) {
  call void @NRT_MemInfo_call_dtor(ptr %data)
  ret void
}

define void @NRT_MemInfo_call_dtor(ptr %meminfo) {
  %used = load i32, ptr @used
  %fewer = sub i32 %used, 1
  store i32 %fewer, ptr @used
  ret void
}

; Another shape of an array in C order: one row of numbers only.
define i32 @numba_attempt_nocopy_reshape(i64 %dims, ptr %shape, ptr %strides, i64 %new_dims, ptr %new_shape, ptr %new_strides, i64 %size, i32 %fortran) {
  %flat = icmp eq i64 %new_dims, 1
  br i1 %flat, label %fits, label %other
fits:
  store i64 %size, ptr %new_strides
  ret i32 1
other:
  ret i32 0
}

define double @sqrt(double %x) {
  %root = call double @llvm.sqrt.f64(double %x)
  ret double %root
}

declare double @llvm.sqrt.f64(double)

; The product of two numbers of 128 bits, which LLVM calls where it has found one: not to be found in here again.
define void @__multi3(ptr %result, i64 %a_low, i64 %a_high, i64 %b_low, i64 %b_high) noinline optnone {
  %a0 = and i64 %a_low, 4294967295
  %a1 = lshr i64 %a_low, 32
  %b0 = and i64 %b_low, 4294967295
  %b1 = lshr i64 %b_low, 32
  %p00 = mul i64 %a0, %b0
  %p10 = mul i64 %a1, %b0
  %p01 = mul i64 %a0, %b1
  %p11 = mul i64 %a1, %b1
  %c0 = lshr i64 %p00, 32
  %m = add i64 %p10, %c0
  %m0 = and i64 %m, 4294967295
  %m1 = lshr i64 %m, 32
  %k = add i64 %p01, %m0
  %k1 = lshr i64 %k, 32
  %h0 = add i64 %p11, %m1
  %h1 = add i64 %h0, %k1
  %x = mul i64 %a_low, %b_high
  %y = mul i64 %a_high, %b_low
  %h2 = add i64 %h1, %x
  %h3 = add i64 %h2, %y
  %low = mul i64 %a_low, %b_low
  store i64 %low, ptr %result
  %at = getelementptr i8, ptr %result, i32 8
  store i64 %h3, ptr %at
  ret void
}

; What LLVM calls for the remainder of numbers.
define double @fmod(double %x, double %y) {
  %result = alloca double
  %error = alloca ptr
  %status = call i32 @"{{remainder_of}}"(ptr %result, ptr %error, double %x, double %y)
  %number = load double, ptr %result
  ret double %number
}
